"""Path-traced frames of Lambertian scenes on Mitsuba 3; it answers no question itself.

Follows section 4.1 of the FLNR paper. Mitsuba traces the rays, holds the scene and samples the
lights; what is here decides which rays, and writes the frames. `scenes/` is what is rendered.
"""
