// Distance from the origin, m, up to which nothing along a ray counts as before a receiver at p with the unit normal n,
// which faces the origin: to the receiver's plane, less what a surface that bends away from it may rise above it.
float receiver_distance(vec3 p, vec3 n, vec3 ray)
{
    float d = length(p), cosine = min(dot(n, ray), -1e-4);
    float t = clamp(dot(n, p) / cosine, 0.5 * d, 2.0 * d);
    float rise = length(cross(ray, p)) + 2e-5 * d;
    return t + rise / cosine;
}

// Where the rays around one to p are to be taken, m, that are up to the angle delta apart. On the side where the plane of
// a surface in grazing light rises towards the light, it soon goes through what shadows the surface, a wall's through the
// roof, and lets light in: beyond 63° (its tangent 2) they are moved to the other side.
vec3 receiver_center(vec3 p, vec3 n, float delta)
{
    float d = length(p), cosine = -dot(n, p) / d;
    vec3 along = n + p * (cosine / d);
    float sine2 = dot(along, along);
    return p + along * (d * delta * max(sqrt(sine2) - 2.0 * max(cosine, 0.0), 0.0) / max(sine2, 1e-6));
}
