// What the vectors call: each image's program, and who answers the board's interrupts. Images without lines
// link no_lines.cpp, where those are faults.
#pragma once

extern "C" {
/// After memory and static objects are set up. When it returns the system starts over.
void leadline_main();
void leadline_tick();
void leadline_uart0_receive();
void leadline_uart0_sent();
void leadline_uart1_receive();
void leadline_uart1_sent();
void leadline_uart2_receive();
void leadline_uart2_sent();
void leadline_uart3_receive();
void leadline_uart3_sent();
void leadline_uart4_receive();
void leadline_uart4_sent();
}
