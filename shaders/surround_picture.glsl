// Pictures of the surroundings as a view sees them. Of each six vec4s: three rows of the map from the view's axes into
// the picture's (metres); (1: panorama, radians of its pixel, width, height); (fx, fy, cx, cy); its gains and its layer.
uniform vec4 pictures[96];

// The view's point along / inverse in a picture's axes, times inverse, so that the infinitely far needs no exception.
// turned: `along` in its axes.
vec3 in_picture(int i, vec3 along, float inverse, out vec3 turned)
{
    vec4 a = pictures[6 * i], b = pictures[6 * i + 1], c = pictures[6 * i + 2];
    turned = vec3(dot(a.xyz, along), dot(b.xyz, along), dot(c.xyz, along));
    return turned + inverse * vec3(a.w, b.w, c.w);
}

bool is_panorama(int i) { return pictures[6 * i + 3].x > 0.5; }

int layer_of(int i) { return int(pictures[6 * i + 5].w); }

// Whether a direction in a picture's axes lies in it.
bool in_frame(int i, vec3 q)
{
    vec2 size = pictures[6 * i + 3].zw;
    vec4 lens = pictures[6 * i + 4];
    vec2 at = lens.xy * q.xy + (lens.zw + 0.5) * q.z;
    return is_panorama(i) || (q.z > 0.0 && all(greaterThan(at, vec2(0.0))) && all(lessThan(at, size * q.z)));
}

// Its pixel: the centre of the top left one is (0, 0).
vec2 pixel_of(int i, vec3 q)
{
    vec2 size = pictures[6 * i + 3].zw;
    vec4 lens = pictures[6 * i + 4];
    if (!is_panorama(i))
        return lens.xy * q.xy / q.z + lens.zw;
    vec2 angles = vec2(atan(q.x, q.z) / 6.28318531 + 0.5, atan(length(q.xz), -q.y) / 3.14159265);
    vec2 at = angles * size - 0.5;
    return vec2(at.x >= size.x - 0.5 ? at.x - size.x : at.x, at.y);
}
