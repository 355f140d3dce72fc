// Plays a source on a thread of its owner's: opens it by URI, again a second after it failed; gives its frames, those
// of a film (a recorded source) at the times at which they were taken; plays a film again from its start; and closes
// the source while its owner is suspended. The owner's struct holds one, and its thread is the player's worker:
//
//     while (source_player_wait_to_play(p)) {
//         enum status status = source_player_open_source(p);
//         while (status == OK && !source_player_must_stop(p)) {
//             status = source_player_next(p, &frame);
//             ...                            // ERR_INPUT: a damaged image; NOTHING: a film is over
//             source_player_wait_for_frame(p);
//         }
//         source_player_close_source(p);
//         if (status != OK)
//             source_player_wait_to_retry(p);
//     }
//
// Times are those of clock_now_ns(), ns. Threads: what is marked so is for the worker's thread alone.
#pragma once
#include "base/threads.h"
#include "platform/sensors/source.h"

struct source_player {
    struct worker_thread worker; // the lock guards `suspended`, and what else the owner's threads share
    bool suspended;

    // Of the worker's thread:
    char *uri;
    enum source_wanted wanted;
    struct source *source; // NULL: closed
    bool film;             // the source is recorded
    int64_t first_ns;      // of a film: the source's time of the frame that was due at began_ns
    int64_t began_ns;      // 0: none yet
    int64_t due_ns;        // when the last frame is to be shown; 0: none yet
    int64_t interval_ns;   // from the frame before to the last one; 0: that was the first
};

// Copies the URI. ERR_MEMORY. Once opened, also with an error, it must be closed. The thread is worker_thread_start's.
MUST_CHECK enum status source_player_open(struct source_player *p, const char *uri, enum source_wanted wanted);
void source_player_close(struct source_player *player); // waits for the thread's end

// From any thread. true: the source is to be closed, and is opened again after the call with false.
void source_player_suspend(struct source_player *player, bool suspend);

// ------------------------------------------------------------ the worker's thread

// While it is suspended, waits. False: the thread must end.
bool source_player_wait_to_play(struct source_player *player);

bool source_player_must_stop(struct source_player *player); // it is suspended, or the thread must end

// The source from its start; one that is open is closed before. A film goes on where it was over: its first frame is
// due one interval after the last one. As source_open.
MUST_CHECK enum status source_player_open_source(struct source_player *p);
void source_player_close_source(struct source_player *player); // one that is closed is fine

// As source_next. NOTHING: a film is over; a live source that ends is ERR_DEVICE.
MUST_CHECK enum status source_player_next(struct source_player *p, struct frame *out);

// Until the last frame is due, or it must stop. Of a live source frames are due at once.
void source_player_wait_for_frame(struct source_player *player);
void source_player_wait_until_ns(struct source_player *player, int64_t when_ns); // or until it must stop
void source_player_wait_to_retry(struct source_player *player);                  // a second, or until it must stop

// The film stood still at its first frame until now.
void source_player_begin(struct source_player *player);
// The film is from here on that much later.
void source_player_delay(struct source_player *player, int64_t delay_ns);
// Others have read the source: its next frame is due at once.
void source_player_resume(struct source_player *player);
