// What near VPLs gave in the frame before, where they and what they light are as they were. An eighth of the pixels,
// in blocks, sums anew, a quarter at rest, and those that were not seen.
uniform sampler2D s_near_sum;
uniform sampler2D s_near_sum_specular;

// Sums over the pixels before, and of their shares.
vec4 near_irradiance = vec4(0.0);
vec4 near_specular = vec4(0.0);
float known = 0.0;

void keep(float share, ivec2 inside)
{
    near_irradiance += share > 0.0 ? share * texelFetch(s_near_sum, inside, 0) : vec4(0.0);
    near_specular += share > 0.0 ? share * texelFetch(s_near_sum_specular, inside, 0) : vec4(0.0);
    known += share;
}

// Frames after which a sum is made anew wherever its pixel is: 9 to 16, so that not all blocks have it at once where what is
// seen moves with their turns.
float oldest(ivec2 pixel)
{
    ivec2 block = pixel >> 3;
    return float(9 + ((5 * block.x + 3 * block.y) & 7));
}

// What the pixel's point of the surface had in the frame before: irradiance, W/m², with the frames since it was summed,
// more where it was known in part; reflected radiance, W/(m² sr). With 0 frames if that is not known, or it is the pixel's
// turn.
void near_before(ivec2 pixel, out vec4 irradiance, out vec4 specular)
{
    ivec2 block = pixel >> 3, parity = block & 1;
    int kind = parity.x + 2 * parity.y + 4 * (((block.x ^ block.y) >> 1) & 1);
    // What is known in part ages fast: at an edge it would be handed on from pixel to pixel.
    float scale = 1.0 / max(known, 1e-6), frames = near_irradiance.a * scale + 1.0 + 8.0 * (1.0 - known);
    bool kept = known > 0.01 && frames <= oldest(pixel) && !any(equal(uvec2(kind), renew.xy));
    irradiance = kept ? vec4(near_irradiance.rgb * scale, frames) : vec4(0.0);
    specular = kept ? near_specular * scale : vec4(0.0);
}
