"""Virtual measurement of one contact of an arm, with the sheet that a test house fills in."""
