// The mean over frames of what the interleaved gather sums: this frame's sum of one subset of the VPLs, times their number,
// joins the mean that the same point of the surface had in the frame before. Samples of other surfaces do not count; where
// there is none, the mean begins anew.

uniform sampler2D s_sum;
uniform sampler2D s_sum_specular;
uniform sampler2D s_mean;

// What else is kept of one of the pixels before, which counts for that share. Each program has its own.
void keep(float share, ivec2 inside);

// Outputs: the mean, and the surface of the G-buffer.
void accumulate(ivec2 cell, out vec4 o_irradiance, out uvec4 o_surface)
{
    ivec2 pixel = pixel_of(cell);
    uvec4 texel = texel_at(s_surface, pixel, size.zw);
    o_irradiance = vec4(0.0);
    o_surface = uvec4(texel.xy, 0u, 0u);
    if (uintBitsToFloat(texel.x) <= 0.0) {
        return;
    }
    ivec2 from = (cell >> cells.x) + (cell & ((1 << cells.x) - 1)) * cells.zw;
    float subsets = float(count.w);
    vec3 irradiance = subsets * texel_at(s_sum, from, scales.zw).rgb, reflected = subsets * texel_at(s_sum_specular, from, scales.zw).rgb;

    vec4 mean = vec4(0.0);
    vec3 specular = vec3(0.0);
    float total = 0.0;
    if (count.x > 0u) {
        vec3 position = read_position(pixel), normal = oct_decode(unpack_pair(texel.y));
        vec3 plane = oct_decode(unpack_pair(texel.z));
        float near = distance(position, eye_ws.xyz) * size.w;
        to_before(pixel, position, normal, plane);
        Before b = before(cell, position, normal, plane, near);
        if (b.seen) {
            for (int k = 0; k < 4; k++) {
                ivec2 inside;
                uvec4 surface;
                float share = share_of(b, k, inside, surface);
                // What does not count may be anything.
                mean += share > 0.0 ? share * texel_at(s_mean, inside, scales.xy) : vec4(0.0);
                specular += share > 0.0 ? share * unpack_radiance(surface.zw) : vec3(0.0);
                total += share;
                keep(share, inside);
            }
        }
    }
    float frames = 0.0;
    if (total > 1e-3) {
        mean /= total;
        mean.rgb *= previous_scale.rgb;
        specular *= previous_scale.rgb / total;
        frames = min(mean.a, float(count.x));
    }
    float share = 1.0 / (frames + 1.0);
    o_irradiance = vec4(mix(mean.rgb, irradiance, share), frames + 1.0);
    o_surface.zw = pack_radiance(mix(specular, reflected, share));
}
