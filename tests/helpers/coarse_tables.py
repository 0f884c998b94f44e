"""Tables that take a second to build: right in all but the last digits that a picture shows."""

from torchbrdf import TableGrid

COARSE_ROUGH = TableGrid(depth=14, apart=12, slant=8, sigmas=12, albedos=7, images=12)
COARSE_HEIGHTFIELD = TableGrid(depth=12, apart=10, slant=7, sigmas=8, albedos=7, images=10)
