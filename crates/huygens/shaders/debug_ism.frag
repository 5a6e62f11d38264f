// Imperfect shadow maps: a part of their atlas, tile by tile. Distance over the farthest in grey; white where there is
// nothing.

uniform sampler2D s_ism;

layout(std140) uniform PassBlock {
    vec4 picture; // xy: its size, pixels
    uvec4 tiles;  // x: texels on a tile's edge, y: tiles in a row of the atlas, z: tiles in a row of the picture, w: rows of it
    uvec4 range;  // x: VPL of the first tile of the picture, y: first VPL that has a map, z: where they end
    vec4 low;
    vec4 scale;
};

layout(location = 0) out vec4 o_color;

void main()
{
    // The first tile stands in the upper left corner.
    vec2 at = vec2(gl_FragCoord.x, picture.y - gl_FragCoord.y) / picture.xy * vec2(tiles.zw);
    uvec2 tile = uvec2(at);
    uint vpl = range.x + tile.y * tiles.z + tile.x;
    vec2 within = vec2(fract(at.x), 1.0 - fract(at.y));
    ivec2 texel = ivec2(uvec2(vpl % tiles.y, vpl / tiles.y) * tiles.x) + ivec2(min(within * float(tiles.x), float(tiles.x) - 0.5));
    bool mapped = vpl >= range.y && vpl < range.z;
    o_color = vec4(vec3(mapped ? texelFetch(s_ism, texel, 0).r : 1.0), 1.0);
}
