#version 300 es
// Fragment of the occluder mesh (transparent, writes depth only) or of the floor: there the alpha of the occlusion
// shadow, the share of the light from above that the body blocks. Each part and foot blocks as a ball about its nearest
// point.
precision highp float;

in vec4 world; // metres; w: 1 floor, 0 room

uniform vec4 bones[26]; // ends of each part and foot, metres; w of the first end: radius, 0 if unknown
uniform vec4 shadow;    // x, y of its centre, its reach (metres), its darkness

out vec4 color; // premultiplied

void main()
{
    float light = 1.0;
    for (int i = 0; i < 26 && world.w > 0.5; i += 2) {
        float radius = bones[i].w;
        vec3 from = bones[i].xyz - world.xyz, along = bones[i + 1].xyz - bones[i].xyz;
        float t = clamp(-dot(from, along) / max(dot(along, along), 1e-6), 0.0, 1.0);
        vec3 to = from + t * along;
        float distance2 = max(dot(to, to), 1e-6);
        // A ball's share of the sky, times the cosine of its elevation from straight up.
        light *= 1.0 - min(radius * radius / distance2, 1.0) * clamp(to.z * inversesqrt(distance2), 0.0, 1.0);
    }
    float rim = 1.0 - smoothstep(0.5, 1.0, distance(world.xy, shadow.xy) / max(shadow.z, 1e-6));
    color = vec4(0.0, 0.0, 0.0, (1.0 - light) * rim * shadow.w);
}
