// A mean of what the interleaved gather sums, with the surface that it belongs to, in two textures:
//   RGBA32F: irradiance, W/m², and in alpha the number of frames or a weight
//   RGBA32UI: x, y: depth and shading normal as in the G-buffer; z, w: reflected radiance, W/(m² sr)

// Radiance in 62 bits: three numbers of 18 bits and the exponent of the largest.
uvec2 pack_radiance(vec3 radiance)
{
    uint exponent = floatBitsToUint(max(max(radiance.r, radiance.g), max(radiance.b, 1e-30))) >> 23;
    uvec3 q = uvec3(min(radiance * uintBitsToFloat((271u - exponent) << 23) + 0.5, 262143.0));
    return uvec2(q.r | (q.g << 18), (q.g >> 14) | (q.b << 4) | (exponent << 22));
}

vec3 unpack_radiance(uvec2 bits)
{
    uvec3 q = uvec3(bits.x, (bits.x >> 18) | (bits.y << 14), bits.y >> 4) & 0x3ffffu;
    return vec3(q) * uintBitsToFloat(((bits.y >> 22) - 17u) << 23);
}
