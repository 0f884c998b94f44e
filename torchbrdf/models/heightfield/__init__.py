"""Random heightfields with Gaussian slopes: sand, plaster, cast and sintered surfaces."""
