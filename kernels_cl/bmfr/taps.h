// The four pixels of the previous frame around the place where a pixel was; the twin of
// jflnr/temporal/reproject.py. Comes after vectors.h, with WIDTH 1.

// Left upper of the four, and their bilinear weights: (0, 0), (1, 0), (0, 1), (1, 1) in x, y. Where the
// motion (two floats) is not finite, or leads outside the frame, the weights are 0.
typedef struct {
    int x, y;
    float weight[4];
} Taps;

#define TAP(taps, i) ((long)((taps).y + (i) / 2) * width + (taps).x + (i) % 2)

INLINE Taps find_taps(global const float *motion, int x, int y, int width, int height)
{
    Taps taps;
    const int known = 0 * motion[0] == 0 && 0 * motion[1] == 0;
    // Far outside there is nothing, and no whole number for it.
    const float there_x = CLAMP(x + motion[0], -2.0f, width + 1.0f);
    const float there_y = CLAMP(y + motion[1], -2.0f, height + 1.0f);
    const float left = floor(there_x), top = floor(there_y);
    taps.x = known ? (int)left : 0;
    taps.y = known ? (int)top : 0;
#pragma unroll
    for (int i = 0; i < 4; ++i) {
        const int column = taps.x + i % 2, row = taps.y + i / 2;
        const int inside = column >= 0 && column < width && row >= 0 && row < height;
        const float share =
            (1 - fabs(there_x - (left + i % 2))) * (1 - fabs(there_y - (top + i / 2)));
        taps.weight[i] = known && inside ? share : 0;
    }
    return taps;
}

// Divides the weights by their sum, unless that is 0.
INLINE float normalise(Taps *taps)
{
    float total = 0;
#pragma unroll
    for (int i = 0; i < 4; ++i) total += taps->weight[i];
#pragma unroll
    for (int i = 0; i < 4; ++i) taps->weight[i] /= total > 0 ? total : 1;
    return total;
}

// The mean of three channels over the taps; one of weight 0 may hold anything.
INLINE float3 gather(global const float *image, const Taps *taps, int width)
{
    float3 mean = 0;
#pragma unroll
    for (int i = 0; i < 4; ++i)
        if (taps->weight[i] > 0) mean += taps->weight[i] * vload3(TAP(*taps, i), image);
    return mean;
}

#define DOT(a, b) ((a).x * (b).x + (a).y * (b).y + (a).z * (b).z)
#define FINITE(v) (0 * (v).x == 0 && 0 * (v).y == 0 && 0 * (v).z == 0)
