"""Beliefs judged by the true places: numbers, how far to trust them, and their text."""
