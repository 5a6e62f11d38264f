// Directions around a pixel on the screen, numbered so that no arc tangent is needed: t = 0…4 goes once around the
// square |x| + |y| = 1.

const int DIRECTIONS = 16;

// Unit vector of direction k, in pixels; k may be any number.
vec2 azimuth_direction(float k)
{
    float t = mod(k * (4.0 / float(DIRECTIONS)), 4.0);
    return normalize(vec2(abs(t - 2.0) - 1.0, 1.0 - abs(mod(t + 1.0, 4.0) - 2.0)));
}

// The number of a direction, 0…DIRECTIONS.
float azimuth_number(vec2 d)
{
    float x = d.x / max(abs(d.x) + abs(d.y), 1e-30);
    float t = d.y >= 0.0 ? 1.0 - x : 3.0 + x;
    return t * (float(DIRECTIONS) / 4.0);
}
