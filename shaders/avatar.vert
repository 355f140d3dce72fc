#version 300 es
// The person's figure: from the tablet camera's axes to its picture, lens and all. What does not hang on who looks
// was worked out before (frame_layer.h).
precision highp float;

layout(location = 0) in vec4 point;  // in the tablet camera's axes, metres; w: 0 for its double at the outer rim, else 1
layout(location = 1) in vec4 places; // in the atlas, and in the shown frame's colours; of their sizes
layout(location = 2) in vec4 there;  // in its depth, likewise; z: how far it should be, metres; w: how squarely seen
layout(location = 3) in vec4 facing; // normal, in the frame's colour camera's axes; w: root of the room's light

uniform vec4 viewer_from_frame[3]; // rows of the turn from those axes into the tablet camera's
uniform vec4 view_lens[3];       // (fx, fy, cx, cy), (k1, k2, p1, p2), (k3, largest r2, width, height)
uniform vec4 view_range;         // nearest and farthest z that are drawn, metres
uniform vec4 kind;               // x: the shown frame's time, seconds of the take; y: half the outline's width, pixels

out vec4 place;    // as places
out vec4 seen;     // as there
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

void main()
{
    place = places;
    seen = there;
    lighting = vec2(facing.w, point.w);

    vec3 p = point.xyz;
    vec2 b = distorted(p, view_lens[1], view_lens[2].x, view_lens[2].y);
    // Pixels, times z; half a pixel because (0, 0) is the first pixel's centre.
    vec2 px = view_lens[0].xy * b + (view_lens[0].zw + 0.5) * p.z;
    // The outline fades from half its width within to half its width without; what faces the viewer stays where it is.
    vec3 outwards = vec3(dot(viewer_from_frame[0].xyz, facing.xyz), dot(viewer_from_frame[1].xyz, facing.xyz),
                         dot(viewer_from_frame[2].xyz, facing.xyz));
    vec2 aside = outwards.xy - p.xy * (outwards.z / p.z);
    float sine = max(length(aside), 1e-3);
    px += (1.0 - 2.0 * point.w) * kind.y * p.z * smoothstep(0.8, 0.95, sine) / sine * aside;
    float n = view_range.x, far = view_range.y;
    gl_Position = vec4(2.0 * px / view_lens[2].zw - p.z, ((far + n) * p.z - 2.0 * far * n) / (far - n), p.z);
}
