#version 300 es
// Fragment of 2D drawing (controls): a tinted texture.
precision highp float;
in vec2 at;
in vec4 tint; // premultiplied
uniform highp sampler2D picture; // premultiplied
out vec4 color;
void main()
{
    color = texture(picture, at) * tint;
}
