// What the pass along rows leaves for the pass along columns: ROWS planes, as in grids.h.
//
// Defines: NOISE, 1 if there is a plane of noise; POSITIONS, 1 if the position is two more guides.

#define ROW_X(i) (K + NOISE + (i))
#define ROW_XX ROW_X(Q + 1 + C)
#define ROWS (K + NOISE + POSITIONS * (Q + C + 2))
