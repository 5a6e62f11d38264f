// Constants and encodings that every stage shares.

const float PI = 3.14159265358979;

// The texel at a place of a texture, `scale` being the reciprocal of its size: sampled in its middle, which drivers without
// graphics hardware do in less time than they fetch. Textures that no sampler object goes with are sampled to the nearest texel.
vec4 texel_at(sampler2D s, ivec2 at, vec2 scale)
{
    return textureLod(s, (vec2(at) + 0.5) * scale, 0.0);
}

uvec4 texel_at(highp usampler2D s, ivec2 at, vec2 scale)
{
    return textureLod(s, (vec2(at) + 0.5) * scale, 0.0);
}

// Octahedral map of the sphere to the square −1…1 (Meyer et al. 2010, "On floating-point normal vectors").
vec2 oct_encode(vec3 d)
{
    vec2 p = d.xy / (abs(d.x) + abs(d.y) + abs(d.z));
    vec2 fold = (1.0 - abs(p.yx)) * vec2(p.x >= 0.0 ? 1.0 : -1.0, p.y >= 0.0 ? 1.0 : -1.0);
    return d.z >= 0.0 ? p : fold;
}

vec3 oct_decode(vec2 p)
{
    vec3 d = vec3(p, 1.0 - abs(p.x) - abs(p.y));
    float t = max(-d.z, 0.0);
    d.xy -= vec2(d.x >= 0.0 ? t : -t, d.y >= 0.0 ? t : -t);
    return normalize(d);
}

// Two numbers −1…1 in 16 bits each. (packSnorm2x16 is not in GLSL 330.)
uint pack_pair(vec2 p)
{
    uvec2 q = uvec2(clamp(p * 0.5 + 0.5, 0.0, 1.0) * 65535.0 + 0.5);
    return q.x | (q.y << 16);
}

vec2 unpack_pair(uint q)
{
    return vec2(uvec2(q & 0xffffu, q >> 16)) / 65535.0 * 2.0 - 1.0;
}

// Four numbers 0…1 in 8 bits each.
uint pack_four(vec4 p)
{
    uvec4 q = uvec4(clamp(p, 0.0, 1.0) * 255.0 + 0.5);
    return q.x | (q.y << 8) | (q.z << 16) | (q.w << 24);
}

vec4 unpack_four(uint q)
{
    return vec4(uvec4(q, q >> 8, q >> 16, q >> 24) & 0xffu) / 255.0;
}
