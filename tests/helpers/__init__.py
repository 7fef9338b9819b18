"""What tests of several rooms make their cases from and compare with: imported as `helpers.NAME`."""
