#version 300 es
// Fragment of a coloured, textured surface.
precision highp float;

in vec2 uv;
in vec4 shade;

uniform highp sampler2D picture; // premultiplied

out vec4 color; // premultiplied

void main()
{
    color = texture(picture, uv) * vec4(shade.rgb * shade.a, shade.a);
}
