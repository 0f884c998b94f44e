"""The He-Torrance-Sillion-Greenberg model: wave optics of a rough surface with Gaussian heights."""
