// Short tones for a countdown (SDL2). One thread. Without a sound device everything else works, silently.
#pragma once
#include "base/status.h"

struct sound;

// NOTHING: there is no sound device; *out is then NULL, which all functions take. ERR_MEMORY.
MUST_CHECK enum status sound_open(struct sound **out);
void sound_close(struct sound **sound);

// Queues a tone of that pitch and length behind those that still play, at most a second of them. Returns immediately.
void sound_tone(struct sound *sound, double hz, double seconds);
