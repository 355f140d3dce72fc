#version 300 es
// What is about the actor, the room and the floor: from the world to the tablet's
// picture, lens and all.
precision highp float;

layout(location = 0) in vec4 point; // w: 0 of the room, metres; 1 of the floor's patch, -1 to 1

uniform vec4 viewer_from_room[3];  // rows of the map into the tablet camera's axes, metres
uniform vec4 viewer_from_floor[3]; // likewise
uniform vec4 world_from_floor[3];  // into the world's
uniform vec4 view_lens[3];         // (fx, fy, cx, cy), (k1, k2, p1, p2), (k3, largest r2, width, height)
uniform vec4 view_range; // nearest and farthest z that are drawn, how far room and floor are set back, metres

out vec4 world; // of the floor; w as point's

// As actor.vert has it.
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
    vec4 h = vec4(point.xyz, 1.0);
    vec3 of_room = vec3(dot(viewer_from_room[0], h), dot(viewer_from_room[1], h), dot(viewer_from_room[2], h));
    vec3 of_floor = vec3(dot(viewer_from_floor[0], h), dot(viewer_from_floor[1], h), dot(viewer_from_floor[2], h));
    vec3 p = point.w > 0.5 ? of_floor : of_room;
    world = vec4(dot(world_from_floor[0], h), dot(world_from_floor[1], h), dot(world_from_floor[2], h), point.w);
    vec2 d = distorted(p, view_lens[1], view_lens[2].x, view_lens[2].y);
    vec2 px = view_lens[0].xy * d + (view_lens[0].zw + 0.5) * p.z;
    float n = view_range.x, f = view_range.y, z = p.z + (point.w > 0.5 ? view_range.w : view_range.z); // seen at p, but as if it lay at z
    gl_Position = vec4((2.0 * px / view_lens[2].zw - p.z) * (z / p.z), ((f + n) * z - 2.0 * f * n) / (f - n), z);
    if (p.z < n)
        gl_Position = vec4(2.0 * px / view_lens[2].zw - p.z, -1.0, p.z); // before the nearest: cut away
}
