"""How jflnr argues: one experiment per question. `python -m experiments list` names them."""
