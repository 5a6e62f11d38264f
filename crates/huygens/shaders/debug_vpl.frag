// The VPL texture: the four texels of each VPL side by side as colours, in lines of so many VPLs from the top: position
// within the scene's bounds, direction, intensity over the greatest, tone mapped, and extent over the scene's radius.

layout(std140) uniform PassBlock {
    vec4 picture; // xy: its size, pixels
    uvec4 tiles;  // z: VPLs in a line of the picture, w: lines
    uvec4 range;  // z: VPLs
    vec4 low;     // xyz: corner of the scene's bounds, m; w: greatest intensity, W/sr
    vec4 scale;   // xyz: 1 / size of the bounds, 1/m; w: 1 / radius, 1/m
};

layout(location = 0) out vec4 o_color;

void main()
{
    vec2 at = vec2(gl_FragCoord.x, picture.y - gl_FragCoord.y) / picture.xy * vec2(float(tiles.z) * 4.0, tiles.w);
    uvec2 cell = uvec2(at);
    uint vpl = cell.y * tiles.z + cell.x / 4u;
    o_color = vec4(0.0, 0.0, 0.0, 1.0);
    if (vpl >= range.z) {
        return;
    }
    int i = int(vpl);
    Vpl v = read_vpl(i);
    switch (cell.x & 3u) {
    case 0u:
        o_color.rgb = (v.position_ws - low.xyz) * scale.xyz;
        break;
    case 1u:
        o_color.rgb = v.direction_ws * 0.5 + 0.5;
        break;
    case 2u:
        o_color.rgb = srgb_from_linear(pbr_neutral(v.intensity / low.w));
        break;
    default:
        o_color.rgb = read_vpl_extent(i).xyz * scale.w;
    }
}
