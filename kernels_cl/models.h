// The planes of models, as in grids.h: (Q + 1) x C coefficients, the Q + 1 of the brightness, and the
// variance of what they predict. Comes after sizes.h.

#define LIGHT_PLANE(q) ((Q + 1) * C + (q))
#define VARIANCE LIGHT_PLANE(Q + 1)
#define MODELS (VARIANCE + 1)
