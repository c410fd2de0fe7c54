"""The live view: a CiberRato viewer client on one side, a web page on the other."""
