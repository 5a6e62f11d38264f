// A mean of what the interleaved gather sums, with the surface that it belongs to, in two textures:
//   RGBA32F: irradiance, W/m², and in alpha the number of frames or a weight
//   RGBA32UI: x, y: depth and shading normal as in the G-buffer; z, w: reflected radiance, W/(m² sr)
// Near sums, see near_before.glsl, are one: irradiance in x, y, reflected radiance in z, w, and frames in what those leave.

// Radiance in 62 bits: three numbers of 18 bits and the exponent of the largest. The two highest bits are left.
uvec2 pack_radiance(vec3 radiance)
{
    uint exponent = (floatBitsToUint(max(max(radiance.r, radiance.g), max(radiance.b, 1e-30))) >> 23) & 0xffu;
    uvec3 q = uvec3(min(radiance * uintBitsToFloat((271u - exponent) << 23) + 0.5, 262143.0));
    return uvec2(q.r | (q.g << 18), (q.g >> 14) | (q.b << 4) | (exponent << 22));
}

vec3 unpack_radiance(uvec2 bits)
{
    uvec3 q = uvec3(bits.x, (bits.x >> 18) | (bits.y << 14), bits.y >> 4) & 0x3ffffu;
    return vec3(q) * uintBitsToFloat((((bits.y >> 22) & 0xffu) - 17u) << 23);
}

// Irradiance, W/m², reflected radiance, W/(m² sr), and a number of frames, 15 at most.
struct NearSum {
    vec3 irradiance;
    vec3 reflected;
    uint frames;
};

uvec4 pack_near(NearSum sum)
{
    uvec4 texel = uvec4(pack_radiance(sum.irradiance), pack_radiance(sum.reflected));
    texel.yw |= uvec2(sum.frames << 30, (sum.frames >> 2) << 30);
    return texel;
}

NearSum unpack_near(uvec4 texel)
{
    return NearSum(unpack_radiance(texel.xy), unpack_radiance(texel.zw), (texel.y >> 30) | ((texel.w >> 30) << 2));
}
