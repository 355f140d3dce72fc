#version 300 es
// The person's figure: from the rest pose, bone by bone, to the tablet's picture,
// lens and all; and to where the shown frame may have seen it.
precision highp float;

layout(location = 0) in vec4 point;  // rest pose, metres; w: where its colours lie, across
layout(location = 1) in vec4 facing; // its normal; w: where its colours lie, down
layout(location = 2) in vec4 bone;   // the three bones it goes with; w: 1 for its double at the outline's outer rim
layout(location = 3) in vec4 share;  // and how much with each

uniform vec4 viewer_from_bone[45]; // rows of each bone's map into the tablet camera's axes, metres
uniform vec4 now_from_bone[45];    // the same into the colour camera's axes of the shown frame
uniform vec4 world_from_now[3];    // rows of the turn from those into the world's
uniform vec4 viewer_from_now[3];   // and into the tablet camera's
uniform vec4 depth_from_color[3];  // rows, metres
uniform vec4 light[9];             // spherical harmonics of the room's light, in x
uniform vec4 view_lens[3];         // (fx, fy, cx, cy), (k1, k2, p1, p2), (k3, largest r2, width, height)
uniform vec4 view_range;           // nearest and farthest z that are drawn, metres
uniform vec4 color_lens[3];        // of the shown frame's colours, as view_lens
uniform vec4 depth_lens[3];        // of its depth
uniform vec4 now_windows[2];       // the parts of its colours and depth that there are: left, top, width, height
uniform vec4 kind;                 // x: 1 if there are any; y: the shown frame's time, seconds of the take;
                                   // z: half of the outline's width, pixels
uniform vec4 shift_range;          // x: how far 32767 steps of a shift go, metres; y: how many points there are
uniform highp sampler2D shifts;    // each point's in the rest pose, for the shown frame (warp.h): high bytes in the
                                   // left half, low bytes in the right; 32768: none

out vec4 place;    // in the atlas, and in the frame's colours; of their sizes
out vec4 seen;     // in the frame's depth, likewise; z: how far it should be there, metres; w: how squarely it is seen
out vec2 lighting; // root of the room's light; how opaque it is

// Where (x, y) / z falls, times z: Brown-Conrady. Beyond the picture's corners the
// polynomial may fold back, so the factor is held there.
vec2 distorted(vec3 p, vec4 k, float k3, float largest)
{
    vec2 q = p.xy / max(p.z, 1e-4);
    float r2 = dot(q, q);
    if (p.z < 1e-4 || r2 > largest) {
        r2 = largest;
        return p.xy * (1.0 + r2 * (k.x + r2 * (k.y + r2 * k3)));
    }
    float radial = 1.0 + r2 * (k.x + r2 * (k.y + r2 * k3));
    vec2 tangential = vec2(2.0 * k.z * q.x * q.y + k.w * (r2 + 2.0 * q.x * q.x),
                           k.z * (r2 + 2.0 * q.y * q.y) + 2.0 * k.w * q.x * q.y);
    return (q * radial + tangential) * p.z;
}

// Pixels; the centre of the first is (0.5, 0.5).
vec2 placed(vec3 p, vec4 lens[3])
{
    return lens[0].xy * distorted(p, lens[1], lens[2].x, lens[2].y) / p.z + lens[0].zw + 0.5;
}

float lit(vec3 n)
{
    float sum = light[0].x + light[1].x * n.x + light[2].x * n.y + light[3].x * n.z + light[4].x * n.x * n.y +
                light[5].x * n.y * n.z + light[6].x * n.x * n.z + light[7].x * (n.x * n.x - n.y * n.y) +
                light[8].x * (3.0 * n.z * n.z - 1.0);
    return clamp(sum, 0.4, 1.6); // as coat.h has it
}

vec3 shifted(vec3 p)
{
    int wide = textureSize(shifts, 0).x / 2, number = gl_VertexID % int(shift_range.y);
    ivec2 at = ivec2(number % wide, number / wide);
    vec3 high = texelFetch(shifts, at, 0).xyz, low = texelFetch(shifts, ivec2(at.x + wide, at.y), 0).xyz;
    return p + (255.0 * (256.0 * high + low) - 32768.0) * (shift_range.x / 32767.0);
}

void main()
{
    vec4 h = vec4(shifted(point.xyz), 1.0), f = vec4(facing.xyz, 0.0);
    vec3 p = vec3(0.0), now = vec3(0.0), turned = vec3(0.0);
    for (int i = 0; i < 3; i++) {
        int number = int(bone[i] + 0.5), row = 3 * number;
        p += share[i] * vec3(dot(viewer_from_bone[row], h), dot(viewer_from_bone[row + 1], h),
                             dot(viewer_from_bone[row + 2], h));
        now += share[i] * vec3(dot(now_from_bone[row], h), dot(now_from_bone[row + 1], h),
                               dot(now_from_bone[row + 2], h));
        turned += share[i] * vec3(dot(now_from_bone[row], f), dot(now_from_bone[row + 1], f),
                                  dot(now_from_bone[row + 2], f));
    }
    turned = normalize(turned);
    vec3 world = vec3(dot(world_from_now[0].xyz, turned), dot(world_from_now[1].xyz, turned),
                      dot(world_from_now[2].xyz, turned));
    lighting = vec2(sqrt(lit(world)), 1.0 - bone.w);

    vec4 now1 = vec4(now, 1.0);
    vec3 d = vec3(dot(depth_from_color[0], now1), dot(depth_from_color[1], now1), dot(depth_from_color[2], now1));
    place = vec4(point.w, facing.w, (placed(now, color_lens) - now_windows[0].xy) / now_windows[0].zw);
    seen = vec4((placed(d, depth_lens) - now_windows[1].xy) / now_windows[1].zw, d.z,
                kind.x * smoothstep(0.15, 0.45, -dot(turned, normalize(now))));
    if (now.z < 0.05 || d.z < 0.05)
        place.zw = vec2(0.0), seen = vec4(0.0); // beside or behind that camera

    vec2 b = distorted(p, view_lens[1], view_lens[2].x, view_lens[2].y);
    // Pixels, times z; half a pixel because (0, 0) is the first pixel's centre.
    vec2 px = view_lens[0].xy * b + (view_lens[0].zw + 0.5) * p.z;
    // The outline fades from half its width within to half its width without; what faces the viewer stays where it is.
    vec3 outwards = vec3(dot(viewer_from_now[0].xyz, turned), dot(viewer_from_now[1].xyz, turned),
                         dot(viewer_from_now[2].xyz, turned));
    vec2 aside = outwards.xy - p.xy * (outwards.z / p.z);
    float sine = max(length(aside), 1e-3);
    px += (2.0 * bone.w - 1.0) * kind.z * p.z * smoothstep(0.8, 0.95, sine) / sine * aside;
    float n = view_range.x, far = view_range.y;
    gl_Position = vec4(2.0 * px / view_lens[2].zw - p.z, ((far + n) * p.z - 2.0 * far * n) / (far - n), p.z);
}
