// Luma, orange and green, and back without loss.

INLINE float3 to_ycocg(float3 c)
{
    return (float3)(
        0.25f * c.x + 0.5f * c.y + 0.25f * c.z, 0.5f * (c.x - c.z),
        0.5f * c.y - 0.25f * c.x - 0.25f * c.z);
}

INLINE float3 to_rgb(float3 c)
{
    return (float3)(c.x + c.y - c.z, c.x + c.z, c.x - c.y - c.z);
}
