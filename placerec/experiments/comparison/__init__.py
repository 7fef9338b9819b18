"""Every method on the same recordings: `placerec compare`."""
