"""From the layers of a frame to the images that the regressions take."""
