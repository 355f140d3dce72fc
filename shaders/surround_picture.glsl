// Pictures of the surroundings as a view sees them, all of one camera. What is done for each is written out for so many
// as the image has (PICTURES, else all that are possible): drivers that draw by the processor are slow to look up
// uniforms by an index that they do not know when they compile.
#ifndef PICTURES
#define PICTURES 16
#endif
uniform vec4 camera[2];    // 1: panorama, radians of a pixel, width, height; fx, fy, cx, cy
uniform vec4 pictures[64]; // of each four: rows of the map from the view's axes into its own (metres); gains, layer

// The view's point along / inverse in a picture's axes, times inverse, so that the infinitely far needs no exception.
// turned: `along` in its axes.
vec3 in_picture(int i, vec3 along, float inverse, out vec3 turned)
{
    vec4 a = pictures[4 * i], b = pictures[4 * i + 1], c = pictures[4 * i + 2];
    turned = vec3(dot(a.xyz, along), dot(b.xyz, along), dot(c.xyz, along));
    return turned + inverse * vec3(a.w, b.w, c.w);
}

int layer_of(int i) { return int(pictures[4 * i + 3].w); }

// Whether a direction in a picture's axes lies in it; false of one that there is not (layer -1).
bool in_frame(int i, vec3 q)
{
    vec2 at = camera[1].xy * q.xy + (camera[1].zw + 0.5) * q.z;
    bool within = q.z > 0.0 && min(at.x, at.y) > 0.0 && at.x < camera[0].z * q.z && at.y < camera[0].w * q.z;
    return pictures[4 * i + 3].w >= 0.0 && (camera[0].x > 0.5 || within);
}

// atan(y, x) to 1e-5, as fast_atan2 in picture/fast_angle.h.
float angle_of(float y, float x)
{
    float ax = abs(x), ay = abs(y), t = min(ax, ay) / max(max(ax, ay), 1e-30), s = t * t;
    float a = ((((-0.01172120 * s + 0.05265332) * s - 0.11643287) * s + 0.19354346) * s - 0.33262347) * s;
    a = (a + 0.99997726) * t;
    a = ay > ax ? 1.57079633 - a : a;
    a = x < 0.0 ? 3.14159265 - a : a;
    return y < 0.0 ? -a : a;
}

// Its pixel: the centre of the top left one is (0, 0).
vec2 pixel_of(vec3 q)
{
    vec2 size = camera[0].zw;
    if (camera[0].x < 0.5)
        return camera[1].xy * q.xy / q.z + camera[1].zw;
    vec2 angles = vec2(angle_of(q.x, q.z) / 6.28318531 + 0.5, angle_of(length(q.xz), -q.y) / 3.14159265);
    return angles * size - 0.5;
}

#if PICTURES > 0
#define FOR_0 FOR_EACH(0)
#else
#define FOR_0
#endif
#if PICTURES > 1
#define FOR_1 FOR_EACH(1)
#else
#define FOR_1
#endif
#if PICTURES > 2
#define FOR_2 FOR_EACH(2)
#else
#define FOR_2
#endif
#if PICTURES > 3
#define FOR_3 FOR_EACH(3)
#else
#define FOR_3
#endif
#if PICTURES > 4
#define FOR_4 FOR_EACH(4)
#else
#define FOR_4
#endif
#if PICTURES > 5
#define FOR_5 FOR_EACH(5)
#else
#define FOR_5
#endif
#if PICTURES > 6
#define FOR_6 FOR_EACH(6)
#else
#define FOR_6
#endif
#if PICTURES > 7
#define FOR_7 FOR_EACH(7)
#else
#define FOR_7
#endif
#if PICTURES > 8
#define FOR_8 FOR_EACH(8)
#else
#define FOR_8
#endif
#if PICTURES > 9
#define FOR_9 FOR_EACH(9)
#else
#define FOR_9
#endif
#if PICTURES > 10
#define FOR_10 FOR_EACH(10)
#else
#define FOR_10
#endif
#if PICTURES > 11
#define FOR_11 FOR_EACH(11)
#else
#define FOR_11
#endif
#if PICTURES > 12
#define FOR_12 FOR_EACH(12)
#else
#define FOR_12
#endif
#if PICTURES > 13
#define FOR_13 FOR_EACH(13)
#else
#define FOR_13
#endif
#if PICTURES > 14
#define FOR_14 FOR_EACH(14)
#else
#define FOR_14
#endif
#if PICTURES > 15
#define FOR_15 FOR_EACH(15)
#else
#define FOR_15
#endif
#define FOR_EACH_PICTURE \
    FOR_0 FOR_1 FOR_2 FOR_3 FOR_4 FOR_5 FOR_6 FOR_7 FOR_8 FOR_9 FOR_10 FOR_11 FOR_12 FOR_13 FOR_14 FOR_15
