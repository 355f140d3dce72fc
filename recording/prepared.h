// What a program has computed from a take and keeps beside it, so that the take opens immediately the next time: the
// table `prepared` (docs/format.md). It can be made again at any time, so nothing depends on it: where it is missing,
// damaged, of another version or made from frames that have changed since, it is not there.
#pragma once
#include "recording/recording.h"

enum prepared_kind { PREPARED_AVATAR = 0 };

// CRC-32 of everything in the take's index that depends on its frames; of a take that is not drawn from depth.
uint32_t take_index_crc(const struct take *take);

// Reads what is kept of the take. The caller frees *bytes. NOTHING: there is none of this version that was made from
// these frames. ERR_IO, ERR_MEMORY.
MUST_CHECK enum status prepared_read(const struct take *take, enum prepared_kind kind, int version, uint8_t **bytes,
                                     size_t *count);

// Keeps it in the file, in one transaction of its own connection; replaces what is there, unless that is of a newer
// version. NOTHING: the file is just being written or cannot be; or what lies at the path does not have this take,
// frame for frame: it was replaced, or the take trimmed or deleted, since it was opened. It stays as it is then.
// ERR_MEMORY. Any thread may call, while others read the file.
MUST_CHECK enum status prepared_write(const char *path, const struct take *take, enum prepared_kind kind, int version,
                                      const void *bytes, size_t count);
