// One direction of the filter that shares the means of the interleaved gather between neighbours (Segovia et al. 2006):
// the mean over a box of n pixels along the direction, in which every one of n subsets of the VPLs counts once; narrower
// the more frames a pixel's mean is of, because it then has more of the subsets itself. Weighted by how much of the same
// surface the pixels are and by their frames. What is known for every pixel is added at the end.
// Inputs: G-buffer, means, sums of every pixel. Outputs: irradiance, W/m², with the sum of the weights in alpha, and reflected radiance,
// W/(m² sr).

uniform sampler2D s_mean;
uniform sampler2D s_mean_specular;
uniform sampler2D s_frames;
uniform sampler2D s_sum;
uniform sampler2D s_sum_specular;

layout(std140) uniform PassBlock {
    ivec4 grid;  // x: n, y: pixels from one that has a mean to the next
    ivec4 along; // xy: direction; z: 1 where the result is for every pixel, else for those that have means
    vec4 width;  // x: square of the width of the box for a mean of one frame, pixels
};

layout(location = 0) out vec4 o_irradiance;
layout(location = 1) out vec4 o_specular;

void main()
{
    ivec2 at = ivec2(gl_FragCoord.xy), pixels = ivec2(size.xy), cells = (pixels + grid.y - 1) / grid.y;
    ivec2 pixel = along.z == 1 ? at : min(at * grid.y + grid.y / 2, pixels - 1);
    ivec2 cell = along.z == 1 ? at / grid.y : at;
    o_irradiance = vec4(0.0);
    o_specular = vec4(0.0);
    uvec4 texel = texelFetch(s_surface, pixel, 0);
    if (uintBitsToFloat(texel.x) <= 0.0) {
        return;
    }
    vec3 position = read_position(pixel);
    vec3 normal = oct_decode(unpack_pair(texel.y)), plane = oct_decode(unpack_pair(texel.z));
    float footprint = distance(position, eye_ws.xyz) * size.w;
    // One of 2 × 2 pixels that has a mean is not always of the pixel's own surface: then its neighbours are.
    float least = grid.y > 1 ? 2.0 : 1.0;
    float across = clamp(sqrt(width.x / max(texelFetch(s_frames, cell, 0).a, 1.0)), least, float(grid.x));
    vec4 diffuse = vec4(0.0);
    vec3 specular = vec3(0.0);
    int reach = int(ceil(0.5 * across - 0.5));
    for (int i = -reach; i <= reach; i++) {
        ivec2 other = cell + along.xy * i;
        if (any(lessThan(other, ivec2(0))) || any(greaterThanEqual(other, cells))) {
            continue;
        }
        ivec2 other_pixel = min(other * grid.y + grid.y / 2, pixels - 1);
        uvec4 other_texel = texelFetch(s_surface, other_pixel, 0);
        if (uintBitsToFloat(other_texel.x) <= 0.0) {
            continue;
        }
        vec3 d = read_position(other_pixel) - position;
        vec3 other_normal = oct_decode(unpack_pair(other_texel.y));
        float off = abs(dot(plane, d)) / (0.05 * length(d) + footprint);
        float weight = pow(max(dot(normal, other_normal), 0.0), 16.0) * exp(-off * off);
        vec4 mean = texelFetch(s_mean, other, 0);
        weight *= clamp(0.5 * across + 0.5 - abs(float(i)), 0.0, 1.0) * mean.a;
        diffuse += weight * vec4(mean.rgb, 1.0);
        specular += weight * texelFetch(s_mean_specular, other, 0).rgb;
    }
    float scale = 1.0 / max(diffuse.a, 1e-6);
    o_irradiance = vec4(diffuse.rgb * scale, diffuse.a);
    o_specular.rgb = specular * scale;
    if (along.z == 1) {
        o_irradiance.rgb += texelFetch(s_sum, pixel, 0).rgb;
        o_specular.rgb += texelFetch(s_sum_specular, pixel, 0).rgb;
    }
}
