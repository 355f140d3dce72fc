#version 300 es
// The room leaves the picture as it is, and the floor takes the actor's shadow: of
// the light from above, what each part of the body keeps away.
precision highp float;

in vec4 world; // metres; w: 1 the floor, 0 the room

uniform vec4 bones[26]; // two ends of each part and of each foot, metres; w of the first: its radius, 0: no such part
uniform vec4 shadow;    // x, y of its middle, how far it reaches, how dark it is

out vec4 color; // premultiplied

void main()
{
    float light = 1.0;
    for (int i = 0; i < 26 && world.w > 0.5; i += 2) {
        float radius = bones[i].w;
        vec3 from = bones[i].xyz - world.xyz, along = bones[i + 1].xyz - bones[i].xyz;
        float t = clamp(-dot(from, along) / max(dot(along, along), 1e-6), 0.0, 1.0);
        vec3 to = from + t * along;
        float away2 = max(dot(to, to), 1e-6);
        // A ball's share of the sky, by how steeply its light falls.
        light *= 1.0 - min(radius * radius / away2, 1.0) * clamp(to.z * inversesqrt(away2), 0.0, 1.0);
    }
    float rim = 1.0 - smoothstep(0.5, 1.0, distance(world.xy, shadow.xy) / max(shadow.z, 1e-6));
    color = vec4(0.0, 0.0, 0.0, (1.0 - light) * rim * shadow.w);
}
