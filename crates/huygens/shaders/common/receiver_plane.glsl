// Distance from the origin, m, up to which nothing along a ray counts as before a receiver at p with the unit normal n,
// which faces the origin: to the receiver's plane, less what a surface that bends away from it may rise above it.
float receiver_distance(vec3 p, vec3 n, vec3 ray)
{
    float d = length(p), cosine = min(dot(n, ray), -1e-4);
    float t = clamp(dot(n, p) / cosine, 0.5 * d, 2.0 * d);
    float rise = length(cross(ray, p)) + 2e-5 * d;
    return t + rise / cosine;
}
