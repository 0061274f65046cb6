"""REST routes: parse, call one operation, render."""
