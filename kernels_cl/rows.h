// What the pass along rows leaves for the pass along columns, in groups of GROUP neighbours with all
// planes side by side: (h, pitch / GROUP, ROWS, GROUP). As separate planes they would be more streams
// than a processor can follow. Comes after grids.h.
//
// Defines: NOISE, 1 if there is a plane of noise; POSITIONS, 1 if the position is two more guides.

#define ROW_X(i) (K + NOISE + (i))
#define ROW_XX ROW_X(Q + 1 + C)
#define ROWS (K + NOISE + POSITIONS * (Q + C + 2))
#define ROWS_AT(x, y, pitch) \
    ((((long)(y) * ((pitch) / GROUP) + (x) / GROUP) * ROWS) * GROUP + (x) % GROUP)
