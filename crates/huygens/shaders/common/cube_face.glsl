// The direction in a cube map of a point −1…1 on one of its faces (0…5: +x −x +y −y +z −z; OpenGL 3.3 core, table 3.19).
vec3 face_direction(int face, vec2 p)
{
    if (face == 0) return vec3(1.0, -p.y, -p.x);
    if (face == 1) return vec3(-1.0, -p.y, p.x);
    if (face == 2) return vec3(p.x, 1.0, p.y);
    if (face == 3) return vec3(p.x, -1.0, -p.y);
    if (face == 4) return vec3(p.x, -p.y, 1.0);
    return vec3(-p.x, -p.y, -1.0);
}
