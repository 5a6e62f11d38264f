// The mean over frames of what the interleaved gather sums: this frame's sum of one subset of the VPLs, times their number,
// joins the mean that the same point of the surface had in the frame before (reverse reprojection: Nehab et al. 2007,
// "Accelerating real-time shading with reverse reprojection caching"). Samples of other surfaces do not count; where
// there is none, the mean begins anew.

uniform sampler2D s_emission;
uniform sampler2D s_sum;
uniform sampler2D s_sum_specular;
uniform sampler2D s_mean;
uniform highp usampler2D s_mean_surface;
uniform sampler2D s_motion;

layout(std140) uniform PassBlock {
    mat4 previous_view_from_world;
    mat4 previous_clip_from_view;
    vec4 previous_unprojection;
    vec4 previous_jitter;
    vec4 previous_scale; // what the means before are multiplied by: how much brighter all VPLs together are now
    ivec4 grid;  // x: n, y: pixels from one that has a sum to the next, zw: size of a layer of sums
    uvec4 count; // x: most frames that the mean before may count for, 0 if there is none; y: 1 if nothing moved; z: 1 if objects did; w: number of subsets
};

// Adds the mean of one cell, if it belongs to the surface through `position` with that plane, both as the camera before
// saw them, and that normal.
void take(ivec2 cell, float share, vec3 position, vec3 plane, vec3 normal, float near, inout vec4 mean, inout vec3 specular,
          inout float total)
{
    ivec2 pixels = ivec2(size.xy), cells = (pixels + grid.y - 1) / grid.y, inside = clamp(cell, ivec2(0), cells - 1);
    uvec4 texel = texelFetch(s_mean_surface, inside, 0);
    float depth = uintBitsToFloat(texel.x);
    ivec2 pixel = min(cell * grid.y + grid.y / 2, pixels - 1);
    vec2 ndc = (vec2(pixel) + 0.5) * size.zw * 2.0 - 1.0 + previous_jitter.xy;
    vec3 d = vec3(ndc * previous_unprojection.xy * (previous_unprojection.z + previous_unprojection.w * depth), -depth) - position;
    bool same = abs(dot(plane, d)) <= 0.05 * length(d) + near && dot(normal, oct_decode(unpack_pair(texel.y))) >= 0.9;
    // Where nothing moved since, rounding is all that differs, and how things moved before.
    bool counts = cell == inside && depth > 0.0 && share > 0.0 && (same || count.y == 1u);
    // What does not count may be anything.
    mean += counts ? share * texelFetch(s_mean, inside, 0) : vec4(0.0);
    specular += counts ? share * unpack_radiance(texel.zw) : vec3(0.0);
    total += counts ? share : 0.0;
}

// Outputs: the mean, and the surface of the G-buffer.
void accumulate(ivec2 cell, out vec4 o_irradiance, out uvec4 o_surface)
{
    ivec2 pixel = min(cell * grid.y + grid.y / 2, ivec2(size.xy) - 1);
    uvec4 texel = texelFetch(s_surface, pixel, 0);
    o_irradiance = vec4(0.0);
    o_surface = uvec4(texel.xy, 0u, 0u);
    if (uintBitsToFloat(texel.x) <= 0.0) {
        return;
    }
    ivec2 from = cell / grid.x + (cell % grid.x) * grid.zw;
    float subsets = float(count.w);
    vec3 irradiance = subsets * texelFetch(s_sum, from, 0).rgb, reflected = subsets * texelFetch(s_sum_specular, from, 0).rgb;

    vec4 mean = vec4(0.0);
    vec3 specular = vec3(0.0);
    float total = 0.0;
    if (count.x > 0u) {
        vec3 position = read_position(pixel), normal = oct_decode(unpack_pair(texel.y));
        vec3 plane = oct_decode(unpack_pair(texel.z));
        float near = distance(position, eye_ws.xyz) * size.w;
        if (count.z == 1u) {
            int instance = int(texelFetch(s_emission, pixel, 0).a);
            ivec2 row = ivec2((instance & 255) * 4, instance >> 8);
            mat4 motion = mat4(texelFetch(s_motion, row, 0), texelFetch(s_motion, row + ivec2(1, 0), 0),
                               texelFetch(s_motion, row + ivec2(2, 0), 0), texelFetch(s_motion, row + ivec2(3, 0), 0));
            position = (motion * vec4(position, 1.0)).xyz;
            normal = normalize(mat3(motion) * normal);
            plane = normalize(mat3(motion) * plane);
        }
        position = (previous_view_from_world * vec4(position, 1.0)).xyz;
        plane = mat3(previous_view_from_world) * plane;
        vec4 clip = previous_clip_from_view * vec4(position, 1.0);
        if (clip.w > 0.0 || count.y == 1u) {
            vec2 at = ((clip.xy / clip.w - previous_jitter.xy) * 0.5 + 0.5) * size.xy - 0.5;
            at = (at - float(grid.y / 2)) / float(grid.y);
            // What is still keeps its mean to the last digit.
            at = count.y == 1u ? vec2(cell) : clamp(at, vec2(-2.0), size.xy + 2.0);
            vec2 low = floor(at), part = at - low;
            for (int k = 0; k < 4; k++) {
                ivec2 corner = ivec2(k & 1, k >> 1);
                vec2 shares = mix(1.0 - part, part, vec2(corner));
                take(ivec2(low) + corner, shares.x * shares.y, position, plane, normal, near, mean, specular, total);
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
