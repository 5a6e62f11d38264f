// A Lambertian VPL stands for a patch of surface, a rectangle that faces its direction. From afar it is a point. Near
// it, where a point would make a spot and miss what the patch sends into a corner, it is the rectangle, of one radiance:
// Lambert's formula (1760) for polygons, with what is below the receiver's horizon cut off (Baum, Rushmeier & Winget
// 1989, "Improving radiosity solutions through the use of analytically determined form-factors").
// Lanes that run together differ, and would take every branch: there are selections in their place.

// A side's part of the form factor times 2π, seen from a point with normal n, from the unit vectors to the ends of the
// side: the angle between them over its sine, times their cross product.
float side_form_factor(vec3 a, vec3 b, vec3 n)
{
    vec3 c = cross(a, b);
    float cosine = dot(a, b), y = abs(cosine);
    // acos(y) / √(1 − y²) for y from 0 to 1, off by 3e-6 of it at most.
    float acute = (1.57079235 + y * (0.33058713 + y * (0.00979819 * y - 0.06425936))) / (1.0 + 0.84691364 * y);
    float obtuse = PI * inversesqrt(max(dot(c, c), 1e-30)) - acute;
    return dot(c, n) * (cosine >= 0.0 ? acute : obtuse);
}

vec3 unit(vec3 v)
{
    return v * inversesqrt(max(dot(v, v), 1e-36));
}

// Irradiance, W/m², for an intensity of 1 W/sr along the direction: at a point at d (m) from VPL i with normal n.
float patch_irradiance(int i, Vpl vpl, vec3 d, vec3 n)
{
    vec4 extent = read_vpl_extent(i);
    vec3 z = vpl.direction_ws;
    vec3 x = normalize(cross(abs(z.z) < 0.9 ? vec3(0.0, 0.0, 1.0) : vec3(1.0, 0.0, 0.0), z)), y = cross(z, x);
    vec3 left = -extent.x * x - d, right = extent.y * x - d, back = -extent.z * y, front = extent.w * y;
    vec3 a = unit(right + back);
    vec3 corners[4] = vec3[4](unit(right + front), unit(left + front), unit(left + back), a);
    // Where the rectangle's outline goes below the horizon, and where it comes up again.
    vec3 down = vec3(0.0), up = vec3(0.0);
    float sum = 0.0, height_a = dot(a, n);
    for (int k = 0; k < 4; k++) {
        vec3 b = corners[k];
        float height_b = dot(b, n);
        bool above_a = height_a > 0.0, above_b = height_b > 0.0;
        float part = above_a != above_b ? height_a / (height_a - height_b) : 0.0;
        vec3 cut = unit(mix(a, b, part));
        vec3 from = above_a ? a : cut, to = above_b ? b : cut;
        down = above_a && !above_b ? cut : down;
        up = above_b && !above_a ? cut : up;
        sum += above_a || above_b ? side_form_factor(from, to, n) : 0.0;
        a = b;
        height_a = height_b;
    }
    sum += side_form_factor(down, up, n);
    // Where what stands on the surface cuts the rectangle, it has the radiance of what is left, and from half as far as
    // it is one the flux.
    float rectangle = (extent.x + extent.y) * (extent.z + extent.w);
    float afar = min(4.0 * dot(d, d) / (vpl.near * vpl.near), 1.0);
    return max(-0.5 * sum, 0.0) * mix(1.0 / (PI * vpl.d_min * vpl.d_min), 1.0 / rectangle, afar);
}
