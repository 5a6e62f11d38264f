// One direction of the filter that shares the means of the interleaved gather between neighbours (Segovia et al. 2006):
// the mean over a box of n pixels along the direction, in which every one of n subsets of the VPLs counts once; narrower
// the more frames a pixel's mean is of, because it then has more of the subsets itself. Weighted by how much of the same
// surface the pixels are and by their frames. What is known for every pixel is added at the end.

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

// What the filter reads of a pixel that has a mean.
struct Tap {
    bool there;       // whether there is a surface
    vec3 position_ws;
    vec3 normal_ws;
    vec4 mean;        // irradiance, W/m², and its weight
    vec3 specular;    // W/(m² sr)
};

// Pixels that have means.
ivec2 cell_count()
{
    return (ivec2(size.xy) + grid.y - 1) / grid.y;
}

ivec2 pixel_of(ivec2 cell)
{
    return min(cell * grid.y + grid.y / 2, ivec2(size.xy) - 1);
}

Tap read_tap(ivec2 cell)
{
    ivec2 pixel = pixel_of(cell);
    uvec4 texel = texelFetch(s_surface, pixel, 0);
    return Tap(uintBitsToFloat(texel.x) > 0.0, read_position(pixel), oct_decode(unpack_pair(texel.y)),
               texelFetch(s_mean, cell, 0), texelFetch(s_mean_specular, cell, 0).rgb);
}

// A cell near the one that is filtered. Each tier has its own.
Tap tap_at(ivec2 cell);

// Outputs: irradiance, W/m², with the sum of the weights in alpha, and reflected radiance, W/(m² sr).
void reconstruct(ivec2 at, out vec4 irradiance, out vec4 reflected)
{
    ivec2 pixel = along.z == 1 ? at : pixel_of(at), cell = along.z == 1 ? at / grid.y : at, cells = cell_count();
    irradiance = vec4(0.0);
    reflected = vec4(0.0);
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
        Tap tap = tap_at(other);
        if (!tap.there) {
            continue;
        }
        vec3 d = tap.position_ws - position;
        float off = abs(dot(plane, d)) / (0.05 * length(d) + footprint);
        float weight = pow(max(dot(normal, tap.normal_ws), 0.0), 16.0) * exp(-off * off);
        weight *= clamp(0.5 * across + 0.5 - abs(float(i)), 0.0, 1.0) * tap.mean.a;
        diffuse += weight * vec4(tap.mean.rgb, 1.0);
        specular += weight * tap.specular;
    }
    float scale = 1.0 / max(diffuse.a, 1e-6);
    irradiance = vec4(diffuse.rgb * scale, diffuse.a);
    reflected.rgb = specular * scale;
    if (along.z == 1) {
        irradiance.rgb += texelFetch(s_sum, pixel, 0).rgb;
        reflected.rgb += texelFetch(s_sum_specular, pixel, 0).rgb;
    }
}
