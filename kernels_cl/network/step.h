// What one level's fit found, beside the coarser one. Comes after sizes.h, grids.h, models.h and
// network/logarithms.h.
//
// Defines: COUNT, the number of planes of moments.

#define OF_STEP 6

// n and the mean guides of blocks, `guides` from index 1 on, which has room for Q + 1.
INLINE real mean_guides(global const float *moments, real *guides)
{
    const real n = READ(moments);
    const real inverse = n > 1e-12f ? 1 / n : (real)0;
    guides[0] = 1;
#pragma unroll
    for (int q = 1; q <= Q; ++q) guides[q] = READ(moments + XX(q, 0) * GROUP) * inverse;
    return inverse;
}

// values: OF_STEP, see `of_step` in jflnr/network/features.py. level: brightness known before. fine:
// models there. at: the same blocks in the models of the coarser grid, share_at in its share.
INLINE void step_values(
    const real *guides, real level, global const float *fine, const coarse_t *at,
    const coarse_t *share_at, float mean, real *values)
{
    real finer = 0, coarser = 0;
    for (int q = 0; q <= Q; ++q) {
        finer += guides[q] * READ(fine + LIGHT_PLANE(q) * GROUP);
        coarser += guides[q] * doubled(at, LIGHT_PLANE(q));
    }
    const real inverse = 1 / (level * level + 0.01f * mean * mean);
    values[0] = log_light(level, mean);
    values[1] = log_light(finer, mean);
    values[2] = log_light(coarser, mean);
    values[3] = 0.5f * log(READ(fine + VARIANCE * GROUP) * inverse + 1e-3f);
    values[4] = 0.5f * log(doubled(at, VARIANCE) * inverse + 1e-3f);
    values[5] = doubled(share_at, 0);
}
