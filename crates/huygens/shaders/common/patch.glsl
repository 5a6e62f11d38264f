// A Lambertian VPL stands for a patch of surface, a rectangle that faces its direction. From afar it is a point. Near
// it, where a point would make a spot and miss what the patch sends into a corner, it is the rectangle, of one radiance:
// Lambert's formula (1760) for polygons, with what is below the receiver's horizon cut off (Baum, Rushmeier & Winget
// 1989, "Improving radiosity solutions through the use of analytically determined form-factors").

// A side's part of the form factor times 2π, seen from a point with normal n, from the ends of the side.
float side_form_factor(vec3 a, vec3 b, vec3 n)
{
    vec3 c = cross(a, b);
    float sine = length(c);
    return sine > 0.0 ? dot(c, n) * (atan(sine, dot(a, b)) / sine) : 0.0;
}

// Irradiance, W/m², for an intensity of 1 W/sr along the direction: at a point at d (m) from VPL i, which faces
// along z, with normal n.
float patch_irradiance(int i, vec3 z, vec3 d, vec3 n)
{
    vec4 extent = read_vpl_extent(i);
    vec3 x = normalize(cross(abs(z.z) < 0.9 ? vec3(0.0, 0.0, 1.0) : vec3(1.0, 0.0, 0.0), z)), y = cross(z, x);
    vec3 left = -extent.x * x - d, right = extent.y * x - d, back = -extent.z * y, front = extent.w * y;
    vec3 a = right + back;
    vec3 corners[4] = vec3[4](right + front, left + front, left + back, a);
    // Where the rectangle's outline goes below the horizon, and where it comes up again.
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
    return max(-0.5 * sum, 0.0) / ((extent.x + extent.y) * (extent.z + extent.w));
}
