/* od.h: the object dictionary: a constant table of what exists, and a struct that holds the values.
 *
 * The table is generated (firmware/drive/dictionary.c); this file only knows its row type. Every
 * access from the bus goes through od_read() and od_write(), which check existence, access, size,
 * range and state and answer with the SDO abort code of CiA 301, table 22. The drive itself uses
 * the fields of the generated struct. No state of its own, no allocation; a lookup is a binary
 * search.
 */
#ifndef BOWDEN_CANOPEN_OD_H
#define BOWDEN_CANOPEN_OD_H

#include <stdbool.h>
#include <stdint.h>

/* Wire types. An I24 has 3 bytes on the wire and an int32_t in the struct of values. */
enum {
    OD_U8,
    OD_U16,
    OD_U32,
    OD_I8,
    OD_I16,
    OD_I24,
    OD_I32,
    OD_TEXT,   /* constant ASCII, read only, kept in the table */
    OD_DOMAIN, /* bytes that are written and read whole; 32-bit words in the struct */
};

/* What an entry is for. Config and calibration are writable only while od_t.config_locked is false.
 */
enum {
    OD_COMMUNICATION,
    OD_IDENTITY,
    OD_CONFIG,
    OD_COMMAND,
    OD_STATE,
    OD_CALIBRATION,
};

/* Bits of od_entry_t.flags. */
enum {
    OD_READ = 1 << 0,
    OD_WRITE = 1 << 1,
    OD_MAP_TX = 1 << 2,      /* may be mapped into a TPDO */
    OD_MAP_RX = 1 << 3,      /* may be mapped into an RPDO */
    OD_PERSIST = 1 << 4,     /* saved by store parameters */
    OD_ADD_NODE_ID = 1 << 5, /* the initial value is relative to the node id ($NODEID in the EDS) */
    OD_URGENT = 1 << 6,      /* the drive evaluates it also in an RPDO that is not taken (pdo.h) */
    OD_GUARD = 1 << 7,       /* protects the RPDO that it is mapped into (pdo_guard.h) */
};

/* Offset of an entry without storage: its value is the initial one, for ever. */
#define OD_NO_STORAGE UINT16_MAX

/* One row: an entry, or `count` equal entries with consecutive sub-indices and storage. */
typedef struct {
    uint16_t index;
    uint8_t sub;     /* first sub-index of the row */
    uint8_t count;   /* sub-indices sub .. sub + count - 1 */
    uint8_t type;    /* OD_U8 .. OD_DOMAIN */
    uint8_t role;    /* OD_COMMUNICATION .. OD_CALIBRATION */
    uint8_t flags;   /* OD_READ | ... */
    uint16_t offset; /* of the first value in the struct of values, bytes; or OD_NO_STORAGE */
    uint32_t low;  /* inclusive limits of a write and the value after power-on; for signed types */
    uint32_t high; /* the two's complement, sign extended to 32 bits; of OD_DOMAIN its bytes */
    uint32_t initial;         /* for OD_TEXT the length in bytes */
    const char *text;         /* OD_TEXT only, else NULL */
    const uint32_t *accepted; /* their number, then the only values that a write may have; NULL: all
                                 from low to high */
} od_entry_t;

/* A dictionary: the table (sorted by index, then sub; not owned), the values (not owned). */
typedef struct {
    const od_entry_t *entries;
    uint16_t count;
    void *values;
    uint8_t node_id;
    bool config_locked;       /* true: writes to config and calibration abort with 0800 0022h */
    uint32_t config_revision; /* counts accepted writes to config and calibration */
} od_t;

/* SDO abort codes (CiA 301, table 22); OD_DONE is none of them and means success. */
typedef uint32_t od_abort_t;
#define OD_DONE UINT32_C(0)
#define OD_ABORT_TOGGLE UINT32_C(0x05030000)
#define OD_ABORT_TIMEOUT UINT32_C(0x05040000)
#define OD_ABORT_COMMAND UINT32_C(0x05040001)
#define OD_ABORT_BLOCK_SIZE UINT32_C(0x05040002)
#define OD_ABORT_SEQUENCE UINT32_C(0x05040003)
#define OD_ABORT_CRC UINT32_C(0x05040004)
#define OD_ABORT_ACCESS UINT32_C(0x06010000)
#define OD_ABORT_WRITE_ONLY UINT32_C(0x06010001)
#define OD_ABORT_READ_ONLY UINT32_C(0x06010002)
#define OD_ABORT_NO_OBJECT UINT32_C(0x06020000)
#define OD_ABORT_NOT_MAPPABLE UINT32_C(0x06040041)
#define OD_ABORT_PDO_LENGTH UINT32_C(0x06040042)
#define OD_ABORT_NO_ROOM UINT32_C(0x05040005)
#define OD_ABORT_HARDWARE UINT32_C(0x06060000)
#define OD_ABORT_LENGTH UINT32_C(0x06070010)
#define OD_ABORT_TOO_LONG UINT32_C(0x06070012)
#define OD_ABORT_TOO_SHORT UINT32_C(0x06070013)
#define OD_ABORT_NO_SUB UINT32_C(0x06090011)
#define OD_ABORT_VALUE UINT32_C(0x06090030)
#define OD_ABORT_TOO_HIGH UINT32_C(0x06090031)
#define OD_ABORT_TOO_LOW UINT32_C(0x06090032)
#define OD_ABORT_NOT_STORED UINT32_C(0x08000020)
#define OD_ABORT_BUSY UINT32_C(0x08000021)
#define OD_ABORT_STATE UINT32_C(0x08000022)
#define OD_ABORT_NO_DATA UINT32_C(0x08000024)

/* Finds the row of index and sub. Returns OD_DONE and sets *entry, else OD_ABORT_NO_OBJECT or
 * OD_ABORT_NO_SUB. O(log count). */
od_abort_t od_find(const od_t *od, uint16_t index, uint8_t sub, const od_entry_t **entry);

/* Bytes on the wire of an entry: 1 .. 4, of OD_TEXT and OD_DOMAIN more. */
uint32_t od_size(const od_entry_t *entry);

/* 32-bit words that hold one value of an entry: 1, of OD_DOMAIN more. */
uint32_t od_words(const od_entry_t *entry);

/* The value of sub in *entry (which must hold it), sign extended; 0 for OD_TEXT, the first word of
 * OD_DOMAIN. No access check. */
uint32_t od_get(const od_t *od, const od_entry_t *entry, uint8_t sub);

/* As od_get() and od_set(): word 0 .. od_words() - 1 of a value. */
uint32_t od_get_word(const od_t *od, const od_entry_t *entry, uint8_t sub, uint32_t word);
void od_set_word(const od_t *od, const od_entry_t *entry, uint8_t sub, uint32_t word,
                 uint32_t value);

/* The value after power-on when nothing was stored, with the node id where that is added. */
uint32_t od_initial(const od_t *od, const od_entry_t *entry);

/* Stores a value without any check, truncated to the type; nothing for entries without storage. */
void od_set(const od_t *od, const od_entry_t *entry, uint8_t sub, uint32_t value);

/* The value of an entry, or 0 when there is none. For the node's own parameters. */
uint32_t od_value(const od_t *od, uint16_t index, uint8_t sub);

/* Is it configuration or calibration, and locked? */
bool od_is_locked(const od_t *od, const od_entry_t *entry);

/* Would a write of `value` from the bus be accepted? Access, range, accepted values and state;
 * changes nothing. */
od_abort_t od_check(const od_t *od, const od_entry_t *entry, uint32_t value);

/* Reads an entry for the bus into bytes[capacity], little-endian; *size is set to its length. */
od_abort_t od_read(const od_t *od, uint16_t index, uint8_t sub, uint8_t *bytes, uint32_t capacity,
                   uint32_t *size);

/* Writes `size` little-endian bytes from the bus, with every check. On an abort nothing has
 * changed; an accepted write to config or calibration counts config_revision up. What the bytes of
 * an OD_DOMAIN mean is not known here: the caller has checked it. */
od_abort_t od_write(od_t *od, uint16_t index, uint8_t sub, const uint8_t *bytes, uint32_t size);

/* The word in four little-endian bytes. */
uint32_t od_word_of(const uint8_t *bytes);

/* The value of `entry`'s type in little-endian bytes, sign extended to 32 bits. */
uint32_t od_decode(const od_entry_t *entry, const uint8_t *bytes);

/* Writes the low `size` bytes of value, little-endian; size 0 .. 4. */
void od_encode(uint32_t value, uint8_t *bytes, uint32_t size);

/* Sets every stored value to its initial one (power-on). */
void od_set_initial(const od_t *od);

/* Sets the node's own parameters (0x1000 .. 0x1FFF, communication and config) to their initial
 * values: NMT reset communication. Error history and identity stay. */
void od_reset_communication(const od_t *od);

#endif
