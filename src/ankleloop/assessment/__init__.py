"""How good an estimate is: scores, residual tests, bootstrap, Cramér-Rao bound."""
