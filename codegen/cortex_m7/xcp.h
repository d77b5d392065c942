/* A calibration tool at the serial line: the part of XCP that reads and writes memory.
 *
 * On SxI with a header of one byte, the length, and a checksum of one byte, the sum of all before
 * it: LEN, packet, SUM. Commands: CONNECT, DISCONNECT, GET_STATUS, SYNCH, SHORT_UPLOAD, SET_MTA,
 * DOWNLOAD, SHORT_DOWNLOAD. No DAQ, no pages, no keys.
 */
#ifndef XCP_H
#define XCP_H

#include <stdint.h>

#define XCP_MOST 16 /* bytes of a packet */

/* Memory from a first byte to before a last one. */
typedef struct {
    const uint8_t *first;
    const uint8_t *last;
} xcp_area;

/* What may be read, what may be written, and where the next DOWNLOAD goes. */
typedef struct {
    xcp_area read;
    xcp_area write;
    uint32_t address;
    int32_t is_connected;
} xcp_slave;

/* Wait for one command at the serial line, do it and answer. Damaged frames are left out. */
void xcp_serve(xcp_slave *slave);

/* Do one command; returns the length of the answer, 0 if there is none. */
uint32_t xcp_answer(xcp_slave *slave, const uint8_t *packet, uint32_t length, uint8_t *answer);

#endif
