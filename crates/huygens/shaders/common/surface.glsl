// Reading the G-buffer. Its one integer texture holds, for each pixel:
//   x: depth along the camera's axis, m, as float bits; 0 where there is no surface
//   y: shading normal, z: geometric normal (the side that is seen), both octahedral in 2 × 16 bits
//   w: roughness, metalness, specular factor, occlusion in 4 × 8 bits

uniform highp usampler2D s_surface;

struct Surface {
    ivec2 pixel;
    float depth;
    vec3 position_ws;
    vec3 normal_ws;
    vec3 geometric_normal_ws;
    float roughness;
    float metallic;
    float specular;
    float occlusion;
};

float read_depth(ivec2 pixel)
{
    return uintBitsToFloat(texel_at(s_surface, pixel, size.zw).x);
}

// What a pixel's centre shows at a depth, m, in view space.
vec3 position_at(ivec2 pixel, float depth)
{
    vec2 ndc = (vec2(pixel) + 0.5) * size.zw * 2.0 - 1.0 + jitter.xy;
    return vec3(ndc * unprojection.xy * (unprojection.z + unprojection.w * depth), -depth);
}

vec3 read_position(ivec2 pixel)
{
    return (world_from_view * vec4(position_at(pixel, read_depth(pixel)), 1.0)).xyz;
}

Surface read_surface(ivec2 pixel)
{
    uvec4 texel = texel_at(s_surface, pixel, size.zw);
    Surface s;
    s.pixel = pixel;
    s.depth = uintBitsToFloat(texel.x);
    s.position_ws = read_position(pixel);
    s.normal_ws = oct_decode(unpack_pair(texel.y));
    s.geometric_normal_ws = oct_decode(unpack_pair(texel.z));
    vec4 material = unpack_four(texel.w);
    s.roughness = material.x;
    s.metallic = material.y;
    s.specular = material.z;
    s.occlusion = material.w;
    return s;
}
