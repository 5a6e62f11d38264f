// Imperfect shadow maps (Ritschel et al. 2008): every VPL splats its own random subset of the scene's surfels into
// its octahedral tile. A surfel stands for a disc, which is cut out texel by texel, up to the edges at which its surface
// ends.

layout(std140) uniform PassBlock {
    uvec4 counts; // x: points of a VPL, y: stride, z: first VPL, w: seed
    uvec4 atlas;  // x: texels on a tile's edge, y: tiles in a row, z: points that stand for one that is near, w: levels of pull-push
    vec4 disc;    // x: radius of a disc, m; y: 1 / farthest distance that the maps hold; z: largest point, pixels
    vec4 target_size; // xy: texels of the atlas
};

// A surfel as a VPL sees it, in the space of the tile.
struct Splat {
    bool hemisphere;
    vec3 offset;  // surfel − VPL, m
    vec3 normal;
    vec4 bend;    // how it bends away from the disc: √curvature along one direction or, w, curvature in all; 1/m
    vec4 edge_a;  // twice the vector across an edge at which the surface ends, w: the distance to it, m
    vec4 edge_b;
    float radius; // of the disc, m
};

// Whether the splat covers a texel of the tile, and the distance to its surface there, over the farthest: to the plane
// of the disc, or to the paraboloid that touches it and bends away.
bool splat_depth(Splat splat, ivec2 texel, out float depth)
{
    int size = int(atlas.x);
    vec3 direction = tile_decode((vec2(texel) + 0.5) / float(size), splat.hemisphere);
    float d = length(splat.offset);
    float slope = dot(splat.normal, direction);
    float t = dot(splat.normal, splat.offset) / (abs(slope) > 1e-5 ? slope : 1e-5);
    vec3 miss = direction * t - splat.offset;
    float miss2 = dot(miss, miss);
    bool inside = t > 0.0;
    if (inside && slope < 0.0 && splat.bend != vec4(0.0)) {
        // From the plane on: slope s = −½ ((k·p)² + w |p|²), p the place along the plane.
        float k_d = dot(splat.bend.xyz, direction), k_p = dot(splat.bend.xyz, miss);
        float a = k_d * k_d + splat.bend.w * (1.0 - slope * slope);
        float b = slope + k_p * k_d + splat.bend.w * dot(miss, direction);
        float c = k_p * k_p + splat.bend.w * miss2;
        float root = b * b - a * c;
        // It may pass over it.
        inside = b < 0.0 && root >= 0.0;
        if (inside) {
            float s = c / (sqrt(root) - b);
            t += s;
            miss += direction * s;
            miss2 = dot(miss, miss) - slope * slope * s * s;
        } else {
            t = -1.0;
        }
    }
    inside = inside && miss2 <= splat.radius * splat.radius
        && dot(miss, splat.edge_a.xyz) <= splat.edge_a.w && dot(miss, splat.edge_b.xyz) <= splat.edge_b.w;
    // However small or slanted, a surfel covers the texel that its centre falls into.
    ivec2 centre = ivec2(tile_encode(splat.offset, splat.hemisphere) * float(size));
    bool behind = splat.hemisphere && splat.offset.z <= 0.0;
    t = inside ? t : (t > 0.0 ? clamp(t, d * 0.5, d * 2.0) : d);
    depth = clamp(t * disc.y, 0.0, 0.9999);
    return inside || !behind && texel == centre;
}
