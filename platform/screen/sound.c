#include "platform/screen/sound.h"

#include <SDL.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

enum { RATE = 22050 };
static const double LOUDNESS = 0.25, FADE_S = 0.01; // a tone that starts abruptly clicks
static const double PI = 3.14159265358979323846;

struct sound {
    SDL_AudioDeviceID device;
};

// Where there is neither a sound card nor a sound server, ALSA fills the terminal with its search for one.
static bool any_device(void)
{
    const char *runtime = getenv("XDG_RUNTIME_DIR");
    char server[512] = "";
    if (runtime)
        snprintf(server, sizeof server, "%s/pulse", runtime);
    return !access("/dev/snd/controlC0", F_OK) || getenv("PULSE_SERVER") || getenv("SDL_AUDIODRIVER") ||
           (*server && !access(server, F_OK));
}

enum status sound_open(struct sound **out)
{
    *out = NULL;
    if (!any_device() || SDL_InitSubSystem(SDL_INIT_AUDIO))
        return NOTHING;
    SDL_AudioSpec wanted = {.freq = RATE, .format = AUDIO_S16SYS, .channels = 1, .samples = 512};
    SDL_AudioDeviceID device = SDL_OpenAudioDevice(NULL, 0, &wanted, NULL, 0);
    struct sound *s = device ? calloc(1, sizeof *s) : NULL;
    if (!s) {
        if (device)
            SDL_CloseAudioDevice(device);
        SDL_QuitSubSystem(SDL_INIT_AUDIO);
        return device ? fail(ERR_MEMORY, "no memory for sound") : NOTHING;
    }
    s->device = device;
    SDL_PauseAudioDevice(device, 0);
    *out = s;
    return OK;
}

void sound_close(struct sound **sound)
{
    if (!*sound)
        return;
    SDL_CloseAudioDevice((*sound)->device);
    SDL_QuitSubSystem(SDL_INIT_AUDIO);
    free(*sound);
    *sound = NULL;
}

void sound_tone(struct sound *sound, double hz, double seconds)
{
    static int16_t samples[RATE];
    const int count = (int)(fmin(seconds, 1) * RATE);
    if (!sound || SDL_GetQueuedAudioSize(sound->device) > RATE * sizeof *samples)
        return;
    for (int i = 0; i < count; i++) {
        const double t = (double)i / RATE, fade = fmin(1, fmin(t, seconds - t) / FADE_S);
        samples[i] = (int16_t)(32767 * LOUDNESS * fade * sin(2 * PI * hz * t));
    }
    SDL_QueueAudio(sound->device, samples, (Uint32)((size_t)count * sizeof *samples));
}
