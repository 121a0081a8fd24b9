/* -- CDR: little-endian XCDR1, as ROS 2 writes it; positions count from behind the 4-byte header ------------------- */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

typedef struct {
    uint8_t *data;
    size_t size, at;
    bool ok; /* false once something did not fit */
} metaros_writer;

typedef struct {
    const uint8_t *data;
    size_t size, at;
    bool ok; /* false once something was missing or too long */
} metaros_reader;

static inline void metaros_put(metaros_writer *w, uint64_t value, size_t bytes) {
    size_t at = (w->at + bytes - 1) / bytes * bytes;
    if (!w->ok || at + bytes > w->size) {
        w->ok = false;
        return;
    }
    while (w->at < at) w->data[w->at++] = 0;
    for (size_t i = 0; i < bytes; i++) w->data[w->at++] = (uint8_t)(value >> (8 * i));
}

static inline uint64_t metaros_get(metaros_reader *r, size_t bytes) {
    size_t at = (r->at + bytes - 1) / bytes * bytes;
    uint64_t value = 0;
    if (!r->ok || at + bytes > r->size) {
        r->ok = false;
        return 0;
    }
    for (size_t i = 0; i < bytes; i++) value |= (uint64_t)r->data[at + i] << (8 * i);
    r->at = at + bytes;
    return value;
}

static inline void metaros_put_float(metaros_writer *w, float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    metaros_put(w, bits, 4);
}

static inline float metaros_get_float(metaros_reader *r) {
    uint32_t bits = (uint32_t)metaros_get(r, 4);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* A board whose double has four bytes (AVR) cannot take part with float64 fields. */
static inline void metaros_put_double(metaros_writer *w, double value) {
    uint64_t bits = 0;
    if (sizeof value != sizeof bits) {
        w->ok = false;
        return;
    }
    memcpy(&bits, &value, sizeof bits);
    metaros_put(w, bits, 8);
}

static inline double metaros_get_double(metaros_reader *r) {
    uint64_t bits = metaros_get(r, 8);
    double value = 0;
    if (sizeof value != sizeof bits) {
        r->ok = false;
        return 0;
    }
    memcpy(&value, &bits, sizeof value);
    return value;
}

static inline void metaros_put_string(metaros_writer *w, const char *text, size_t capacity) {
    const char *end = (const char *)memchr(text, 0, capacity);
    size_t length = end ? (size_t)(end - text) : capacity - 1;
    metaros_put(w, length + 1, 4);
    if (!w->ok || w->size - w->at < length + 1) {
        w->ok = false;
        return;
    }
    memcpy(w->data + w->at, text, length);
    w->data[w->at + length] = 0;
    w->at += length + 1;
}

static inline void metaros_get_string(metaros_reader *r, char *text, size_t capacity) {
    uint64_t length = metaros_get(r, 4);
    text[0] = 0;
    if (!r->ok || length > r->size - r->at || length > capacity) {
        r->ok = false;
        return;
    }
    if (length == 0) return;
    memcpy(text, r->data + r->at, (size_t)length);
    text[length - 1] = 0;
    r->at += (size_t)length;
}

static inline uint32_t metaros_put_count(metaros_writer *w, uint32_t count, uint32_t capacity) {
    if (count > capacity) w->ok = false;
    metaros_put(w, count, 4);
    return w->ok ? count : 0;
}

static inline uint32_t metaros_get_count(metaros_reader *r, uint32_t capacity) {
    uint32_t count = (uint32_t)metaros_get(r, 4);
    if (count > capacity) r->ok = false;
    return r->ok ? count : 0;
}

static inline metaros_writer metaros_begin_write(uint8_t *out, size_t capacity) {
    metaros_writer w = {out + 4, capacity < 4 ? 0 : capacity - 4, 0, capacity >= 4};
    if (w.ok) memcpy(out, "\0\1\0\0", 4);
    return w;
}

static inline metaros_reader metaros_begin_read(const uint8_t *data, size_t size) {
    metaros_reader r = {data + 4, size < 4 ? 0 : size - 4, 0, size >= 4};
    if (r.ok && (data[0] != 0 || data[1] != 1)) r.ok = false; /* big-endian, or no CDR */
    return r;
}

/* -- Frames: COBS between zero bytes, CRC-16/IBM-3740; docs/reference/serial_boards.md ----------------------------- */

enum {
    METAROS_VERSION = 1,
    METAROS_HELLO = 0x01, METAROS_DECLARE = 0x02, METAROS_DATA = 0x03, METAROS_LOG = 0x04, METAROS_PING = 0x05,
    METAROS_ASK = 0x81, METAROS_ANSWER = 0x82, METAROS_DATA_IN = 0x83, METAROS_PONG = 0x85
};

typedef struct {
    uint8_t *out;
    size_t capacity, at, code_at;
    uint8_t code;
    uint16_t crc;
    bool ok;
} metaros_frame_writer;

static inline uint16_t metaros_crc(uint16_t crc, uint8_t byte) {
    crc ^= (uint16_t)((uint16_t)byte << 8);
    for (int i = 0; i < 8; i++) crc = (uint16_t)(crc & 0x8000 ? (crc << 1) ^ 0x1021 : crc << 1);
    return crc;
}

static inline void metaros_frame_raw(metaros_frame_writer *f, uint8_t byte) {
    if (f->at >= f->capacity) {
        f->ok = false;
        return;
    }
    f->out[f->at++] = byte;
}

static inline void metaros_frame_block(metaros_frame_writer *f) {
    if (f->ok) f->out[f->code_at] = f->code;
    f->code_at = f->at;
    f->code = 1;
    metaros_frame_raw(f, 0);
}

static inline void metaros_frame_cobs(metaros_frame_writer *f, uint8_t byte) {
    if (f->code == 0xFF) metaros_frame_block(f);
    if (byte) {
        metaros_frame_raw(f, byte);
        f->code++;
    } else {
        metaros_frame_block(f);
    }
}

static inline void metaros_frame_add(metaros_frame_writer *f, const void *data, size_t size) {
    for (size_t i = 0; i < size; i++) {
        uint8_t byte = ((const uint8_t *)data)[i];
        f->crc = metaros_crc(f->crc, byte);
        metaros_frame_cobs(f, byte);
    }
}

static inline metaros_frame_writer metaros_frame_begin(uint8_t *out, size_t capacity, uint8_t kind, uint8_t channel) {
    metaros_frame_writer f = {out, capacity, 0, 0, 1, 0xFFFF, true};
    metaros_frame_raw(&f, 0);
    metaros_frame_add(&f, &kind, 1);
    metaros_frame_add(&f, &channel, 1);
    return f;
}

/* The bytes to send; 0 where they do not fit. */
static inline size_t metaros_frame_end(metaros_frame_writer *f) {
    uint16_t crc = f->crc;
    metaros_frame_cobs(f, (uint8_t)crc);
    metaros_frame_cobs(f, (uint8_t)(crc >> 8));
    if (f->ok) f->out[f->code_at] = f->code;
    metaros_frame_raw(f, 0);
    return f->ok ? f->at : 0;
}

static inline size_t metaros_frame(uint8_t *out, size_t capacity, uint8_t kind, uint8_t channel, const void *payload,
                                   size_t size) {
    metaros_frame_writer f = metaros_frame_begin(out, capacity, kind, channel);
    metaros_frame_add(&f, payload, size);
    return metaros_frame_end(&f);
}

/* `boot`: another number at each start, so that the driver notices that the board forgot everything. */
static inline size_t metaros_hello(uint8_t *out, size_t capacity, uint32_t boot, const char *name) {
    uint8_t head[5] = {METAROS_VERSION, (uint8_t)boot, (uint8_t)(boot >> 8), (uint8_t)(boot >> 16),
                       (uint8_t)(boot >> 24)};
    metaros_frame_writer f = metaros_frame_begin(out, capacity, METAROS_HELLO, 0);
    metaros_frame_add(&f, head, sizeof head);
    metaros_frame_add(&f, name, strlen(name));
    return metaros_frame_end(&f);
}

static inline size_t metaros_declare(uint8_t *out, size_t capacity, uint8_t channel, bool subscribes, const char *topic,
                                     const char *type) {
    uint8_t direction = subscribes ? 1 : 0, topic_size = (uint8_t)strlen(topic), type_size = (uint8_t)strlen(type);
    metaros_frame_writer f = metaros_frame_begin(out, capacity, METAROS_DECLARE, channel);
    metaros_frame_add(&f, &direction, 1);
    metaros_frame_add(&f, &topic_size, 1);
    metaros_frame_add(&f, topic, topic_size);
    metaros_frame_add(&f, &type_size, 1);
    metaros_frame_add(&f, type, type_size);
    return metaros_frame_end(&f);
}

typedef struct {
    uint8_t *buffer; /* what a frame may have, its COBS included */
    size_t size, used;
    bool skipping;
} metaros_receiver;

typedef struct {
    uint8_t kind, channel;
    const uint8_t *payload; /* within the receiver's buffer: until the next byte is fed */
    size_t size;
} metaros_received;

/* Whether the byte ended a whole, right frame. */
static inline bool metaros_receive(metaros_receiver *r, uint8_t byte, metaros_received *frame) {
    if (byte) {
        if (r->used >= r->size) r->skipping = true;
        if (!r->skipping) r->buffer[r->used++] = byte;
        return false;
    }
    size_t used = r->used, from = 0, to = 0;
    bool good = !r->skipping && used > 0;
    r->used = 0;
    r->skipping = false;
    while (good && from < used) {
        uint8_t code = r->buffer[from++];
        if ((size_t)(code - 1) > used - from) good = false;
        for (uint8_t i = 1; good && i < code; i++) r->buffer[to++] = r->buffer[from++];
        if (good && code < 0xFF && from < used) r->buffer[to++] = 0;
    }
    if (!good || to < 4) return false;
    uint16_t crc = 0xFFFF;
    for (size_t i = 0; i < to - 2; i++) crc = metaros_crc(crc, r->buffer[i]);
    if ((uint8_t)crc != r->buffer[to - 2] || (uint8_t)(crc >> 8) != r->buffer[to - 1]) return false;
    frame->kind = r->buffer[0];
    frame->channel = r->buffer[1];
    frame->payload = r->buffer + 2;
    frame->size = to - 4;
    return true;
}

/* -- zenoh-pico: the key and the attachment that rmw_zenoh and Meta-ROS nodes expect -------------------------------- */

/* `topic` begins with a slash; 0 where it does not fit. */
static inline size_t metaros_key(char *out, size_t capacity, unsigned domain, const char *topic, const char *dds_type,
                                 const char *type_hash) {
    int size = snprintf(out, capacity, "%u/%s/%s/%s", domain, topic + 1, dds_type, type_hash);
    return size > 0 && (size_t)size < capacity ? (size_t)size : 0;
}

/* 33 bytes: the publisher's count from 1, nanoseconds since the Unix epoch, and an id of 16 bytes that it keeps. */
static inline void metaros_attachment(uint8_t out[33], int64_t sequence, int64_t stamp_ns, const uint8_t id[16]) {
    for (int i = 0; i < 8; i++) {
        out[i] = (uint8_t)((uint64_t)sequence >> (8 * i));
        out[8 + i] = (uint8_t)((uint64_t)stamp_ns >> (8 * i));
    }
    out[16] = 16;
    memcpy(out + 17, id, 16);
}
