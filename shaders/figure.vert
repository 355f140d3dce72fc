#version 300 es
// The person's figure: from the rest pose, part by part, to the tablet's picture,
// lens and all.
precision highp float;

layout(location = 0) in vec4 point;  // rest pose, metres; w: when it was seen best, seconds of the take
layout(location = 1) in vec4 facing; // its normal; w: 1 if nobody saw it
layout(location = 2) in vec4 part;   // the three parts it goes with
layout(location = 3) in vec4 share;  // and how much with each
layout(location = 4) in vec4 own;    // its colour in the mean light, linear

uniform vec4 viewer_from_part[33]; // rows of each part's map into the tablet camera's axes, metres
uniform vec4 now_from_part[33];    // the same into the colour camera's axes of the shown frame
uniform vec4 world_from_now[3];    // rows of the turn from those into the world's
uniform vec4 absent[3];            // of each part: 1 if it is not to be drawn
uniform vec4 light[9];             // spherical harmonics of the room's light, in x
uniform vec4 view_lens[3];         // (fx, fy, cx, cy), (k1, k2, p1, p2), (k3, largest r2, width, height)
uniform vec4 view_range;           // nearest and farthest z that are drawn, metres
uniform vec4 shift_grid[2];        // what warp.h has for the shown frame: (corner, step), (sizes, largest shift)
uniform highp sampler2D shifts;

// (At a triangle's edge never beyond it: what lies there is somebody else's.)
centroid out vec4 now_point;  // colour camera's axes of the shown frame, metres; w: when, seconds of the take
centroid out vec4 now_facing; // w: 1 if nobody saw it
centroid out vec4 borrowed;   // linear; w: how much it goes with absent parts

vec2 distorted(vec3 p, vec4 k, float k3, float largest)
{
    // Beyond the picture's corners the polynomial may fold back, so the factor is held there.
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

float lit(vec3 n)
{
    float sum = light[0].x + light[1].x * n.x + light[2].x * n.y + light[3].x * n.z + light[4].x * n.x * n.y +
                light[5].x * n.y * n.z + light[6].x * n.x * n.z + light[7].x * (n.x * n.x - n.y * n.y) +
                light[8].x * (3.0 * n.z * n.z - 1.0);
    return clamp(sum, 0.4, 1.6); // as coat.h has it
}

vec3 shifted(vec3 p)
{
    vec3 q = (p - shift_grid[0].xyz) / shift_grid[0].w, last = shift_grid[1].xyz - 2.0;
    ivec3 cell = ivec3(clamp(q, vec3(0.0), last));
    vec3 t = clamp(q - vec3(cell), 0.0, 1.0), sum = vec3(0.0);
    for (int i = 0; i < 8; i++) {
        ivec3 side = ivec3(i & 1, i >> 1 & 1, i >> 2), at = cell + side;
        vec3 share = mix(1.0 - t, t, vec3(side));
        vec3 code = texelFetch(shifts, ivec2(at.x, at.z * int(shift_grid[1].y) + at.y), 0).xyz;
        sum += share.x * share.y * share.z * (code * 255.0 - 128.0);
    }
    return p + sum * (shift_grid[1].w / 127.0);
}

void main()
{
    vec4 h = vec4(shifted(point.xyz), 1.0), f = vec4(facing.xyz, 0.0);
    float missing = 0.0;
    vec3 p = vec3(0.0), now = vec3(0.0), turned = vec3(0.0);
    for (int i = 0; i < 3; i++) {
        int number = int(part[i] + 0.5), row = 3 * number;
        missing += share[i] * absent[number / 4][number % 4];
        p += share[i] * vec3(dot(viewer_from_part[row], h), dot(viewer_from_part[row + 1], h),
                             dot(viewer_from_part[row + 2], h));
        now += share[i] * vec3(dot(now_from_part[row], h), dot(now_from_part[row + 1], h),
                               dot(now_from_part[row + 2], h));
        turned += share[i] * vec3(dot(now_from_part[row], f), dot(now_from_part[row + 1], f),
                                  dot(now_from_part[row + 2], f));
    }
    turned = normalize(turned);
    now_point = vec4(now, point.w);
    now_facing = vec4(turned, facing.w);
    vec3 world = vec3(dot(world_from_now[0].xyz, turned), dot(world_from_now[1].xyz, turned),
                      dot(world_from_now[2].xyz, turned));
    borrowed = vec4(own.xyz * lit(world), missing);

    vec2 d = distorted(p, view_lens[1], view_lens[2].x, view_lens[2].y);
    // Pixels, times z; half a pixel because (0, 0) is the first pixel's centre.
    vec2 px = view_lens[0].xy * d + (view_lens[0].zw + 0.5) * p.z;
    float n = view_range.x, far = view_range.y;
    gl_Position = vec4(2.0 * px / view_lens[2].zw - p.z, ((far + n) * p.z - 2.0 * far * n) / (far - n), p.z);
}
