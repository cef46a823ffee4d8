// Light as the network reads it (jflnr/network/features.py). Comes after vectors.h.
//
// Define: DARK, the share of the frame's mean below which light is as good as dark.

INLINE real log_light(real light, float mean) { return log(MAX(light, 0) / mean + DARK); }
