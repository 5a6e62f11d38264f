// One direction of the filter that shares the means of the interleaved gather between neighbours (Segovia et al. 2006):
// the mean over a box of n pixels along the direction, in which every one of n subsets of the VPLs counts once; narrower
// the more frames a pixel's mean is of, because it then has more of the subsets itself: along a row as if its neighbours had
// as many, and along a column by how many sums those along its row are. Weighted by how much of the same surface the
// pixels are and by their frames. What is known for every pixel is added at the end.

uniform sampler2D s_mean;
uniform highp usampler2D s_mean_surface;

layout(std140) uniform PassBlock {
    ivec4 grid;  // x: n, y: binary logarithm of the pixels from one that has a mean to the next
    ivec4 along; // xy: direction; z: 1 where the result is for every pixel, else for those that have means
    vec4 width;  // x: sums that the box is to hold, of which each pixel has as many as frames; yz: reciprocals of the size of what has means
};

// What the filter reads of a pixel that has a mean.
struct Tap {
    vec3 position_vs; // m; its depth is 0 where there is no surface
    vec3 normal_ws;
    vec4 mean;        // irradiance, W/m², and its weight
    vec3 specular;    // W/(m² sr)
};

// Pixels that have means.
ivec2 cell_count()
{
    return ((ivec2(size.xy) - 1) >> grid.y) + 1;
}

ivec2 pixel_of(ivec2 cell)
{
    return min((cell << grid.y) + ((1 << grid.y) >> 1), ivec2(size.xy) - 1);
}

Tap read_tap(ivec2 cell)
{
    uvec4 texel = texel_at(s_mean_surface, cell, width.yz);
    return Tap(position_at(pixel_of(cell), uintBitsToFloat(texel.x)), oct_decode(unpack_pair(texel.y)),
               texel_at(s_mean, cell, width.yz), unpack_radiance(texel.zw));
}

// A cell near the one that is filtered. Each tier has its own.
Tap tap_at(ivec2 cell);

// Inputs: a pixel, its G-buffer. Outputs: irradiance, W/m², with the sum of the weights in alpha, and reflected radiance,
// W/(m² sr).
void reconstruct(ivec2 pixel, uvec4 texel, out vec4 irradiance, out vec3 reflected)
{
    irradiance = vec4(0.0);
    reflected = vec3(0.0);
    if (uintBitsToFloat(texel.x) <= 0.0) {
        return;
    }
    vec3 position = position_at(pixel, uintBitsToFloat(texel.x));
    vec3 normal = oct_decode(unpack_pair(texel.y)), plane = mat3(view_from_world) * oct_decode(unpack_pair(texel.z));
    float footprint = length(position) * size.w;
    ivec2 cell = pixel >> grid.y;
    // One of 2 × 2 pixels that has a mean is not always of the pixel's own surface: then its neighbours are.
    float least = grid.y > 0 ? 2.0 : 1.0;
    float has = max(texel_at(s_mean, cell, width.yz).a, 1.0), across = width.x / has;
    across = clamp(along.z == 1 ? across : sqrt(across), least, float(grid.x));
    int reach = int(ceil(0.5 * across - 0.5)), place = cell.x * along.x + cell.y * along.y;
    ivec2 cells = cell_count();
    int last = min(reach, cells.x * along.x + cells.y * along.y - 1 - place);
    // A pixel half way between two columns of such cells looks at both: one may be of another surface all along.
    int before = along.z == 1 && pixel_of(cell).x > pixel.x && cell.x > 0 ? 1 : 0;
    do {
        int i = max(-reach, -place);
        do {
            Tap tap = tap_at(cell + along.xy * i - ivec2(before, 0));
            vec3 d = tap.position_vs - position;
            float off = dot(plane, d) / (0.05 * length(d) + footprint);
            // The cosine to the power of 16.
            float weight = max(dot(normal, tap.normal_ws), 0.0);
            weight *= weight;
            weight *= weight;
            weight *= weight;
            weight *= weight * exp(-off * off);
            // Where no cell is of the pixel's surface, others are better than none.
            weight = max(weight, grid.y > 0 ? 1e-3 : 0.0) * clamp(0.5 * across + 0.5 - abs(float(i)), 0.0, 1.0) * tap.mean.a;
            bool counts = tap.position_vs.z < 0.0 && weight > 0.0;
            irradiance += counts ? weight * vec4(tap.mean.rgb, 1.0) : vec4(0.0);
            reflected += counts ? weight * tap.specular : vec3(0.0);
            i++;
        } while (i <= last);
        before--;
    } while (before >= 0);
    float scale = 1.0 / max(irradiance.a, 1e-12);
    irradiance.rgb *= scale;
    reflected *= scale;
}
