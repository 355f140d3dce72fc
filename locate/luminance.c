// Luminance of an RGB image, and its mirror image. Splitting three bytes a pixel is five times faster with instructions
// that not every x86 processor has, so the compiler makes several versions and the loader chooses; with integers all
// give the same result. Not under sanitizers, which interfere with the loader's choice, nor with clang 14, which
// mangles the name.
#include "locate/tag_corners.h"

#if defined(__x86_64__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define TARGET_CLONES __attribute__((target_clones("avx2", "ssse3", "default")))
#else
#define TARGET_CLONES
#endif

TARGET_CLONES
void gray_from_rgb(const uint8_t *restrict rgb, size_t pixels, uint8_t *restrict gray)
{
    for (size_t i = 0; i < pixels; i++) // BT.601, in 256ths
        gray[i] = (uint8_t)((77 * rgb[3 * i] + 150 * rgb[3 * i + 1] + 29 * rgb[3 * i + 2] + 128) >> 8);
}

void gray_mirror(uint8_t *gray, int width, int height)
{
    for (int y = 0; y < height; y++, gray += width)
        for (int x = 0; 2 * x < width - 1; x++) {
            const uint8_t left = gray[x];
            gray[x] = gray[width - 1 - x];
            gray[width - 1 - x] = left;
        }
}
