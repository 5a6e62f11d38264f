// A Lambertian VPL stands for a patch of surface, a disc of the radius d_min that faces its direction. From afar it is a
// point. Near it, where a point would make a spot and miss what the patch sends into a corner, it is a square of the
// same area and of one radiance: Lambert's formula (1760) for polygons, with what is below the receiver's horizon cut
// off (Baum, Rushmeier & Winget 1989, "Improving radiosity solutions through the use of analytically determined
// form-factors").

// Radii within which it is a square.
const float NEAR_RADII = 4.0;

// A side's part of the form factor times 2π, seen from a point with normal n, from the ends of the side.
float side_form_factor(vec3 a, vec3 b, vec3 n)
{
    vec3 c = cross(a, b);
    float sine = length(c);
    return sine > 0.0 ? dot(c, n) * (atan(sine, dot(a, b)) / sine) : 0.0;
}

// Irradiance, W/m², for an intensity of 1 W/sr along the direction: at a point at d (m) from the VPL, with normal n.
float patch_irradiance(Vpl vpl, vec3 d, vec3 n)
{
    float half_side = 0.5 * sqrt(PI) * vpl.d_min;
    vec3 z = vpl.direction_ws;
    vec3 x = half_side * normalize(cross(abs(z.z) < 0.9 ? vec3(0.0, 0.0, 1.0) : vec3(1.0, 0.0, 0.0), z));
    vec3 y = cross(z, x), a = x - y - d;
    vec3 corners[4] = vec3[4](x + y - d, y - x - d, -x - y - d, x - y - d);
    // Where the square's outline goes below the horizon, and where it comes up again.
    vec3 down = vec3(0.0), up = vec3(0.0);
    float sum = 0.0, height_a = dot(a, n);
    for (int k = 0; k < 4; k++) {
        vec3 b = corners[k];
        float height_b = dot(b, n);
        vec3 cut = mix(a, b, height_a * height_b < 0.0 ? height_a / (height_a - height_b) : 0.0);
        if (height_a > 0.0 && height_b > 0.0) {
            sum += side_form_factor(a, b, n);
        } else if (height_a > 0.0) {
            down = height_b < 0.0 ? cut : b;
            sum += side_form_factor(a, down, n);
        } else if (height_b > 0.0) {
            up = height_a < 0.0 ? cut : a;
            sum += side_form_factor(up, b, n);
        }
        a = b;
        height_a = height_b;
    }
    sum += side_form_factor(down, up, n);
    return max(-0.5 / PI * sum, 0.0) / (vpl.d_min * vpl.d_min);
}
