#version 300 es
// The actor and the occlusion shadow over the camera image, pixel for pixel.
precision highp float;
uniform highp sampler2D camera_image;
uniform highp sampler2D actor_image;  // premultiplied
uniform highp sampler2D shadow_image; // premultiplied, of lower resolution; one pixel if there is none
out vec4 color;

float shadow_at(vec2 uv)
{
    ivec2 size = textureSize(shadow_image, 0), most = size - 1;
    vec2 between = uv * vec2(size) - 0.5, low = floor(between), t = between - low;
    ivec2 a = clamp(ivec2(low), ivec2(0), most), b = clamp(ivec2(low) + 1, ivec2(0), most);
    float above = mix(texelFetch(shadow_image, a, 0).a, texelFetch(shadow_image, ivec2(b.x, a.y), 0).a, t.x);
    float below = mix(texelFetch(shadow_image, ivec2(a.x, b.y), 0).a, texelFetch(shadow_image, b, 0).a, t.x);
    return mix(above, below, t.y);
}

void main()
{
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec4 actor = texelFetch(actor_image, at, 0);
    float shadow = shadow_at(gl_FragCoord.xy / vec2(textureSize(camera_image, 0)));
    color = vec4(texelFetch(camera_image, at, 0).rgb * (1.0 - shadow) * (1.0 - actor.a) + actor.rgb, 1.0);
}
