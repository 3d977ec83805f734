/* bus.c: which register model answers an address, and the rules of the buses in between.
 *
 * RM0090 2.3 (memory map). A peripheral whose clock is off in RCC reads 0 and ignores writes. On
 * the APB buses an 8- or 16-bit write is repeated in all lanes of the 32-bit register (RM0090 2.1
 * and the bridge's description); on AHB it changes its own lanes. A reserved address is a bus
 * fault; a peripheral that exists but is not modelled reads 0 and is noted.
 */
#include "system.h"

#include <string.h>

enum { AHB1, AHB2, AHB3, APB1, APB2, ALWAYS };
enum { NOTHING, TIM, ADC, CAN, GPIO, RCC, FLASH, PWR, IWDG, EXTI, SYSCFG, BACKUP, CRC, UNMODELLED };

typedef struct {
    uint32_t base;
    uint8_t kind, instance, bus, enable_bit;
    const char *name;
} block_t;

/* Each 1 KiB block of 0x40000000..0x4007FFFF. The three ADCs share one and have a bit each. */
static const block_t BLOCKS[] = {
    {0x40000000, TIM, 2, APB1, 0, "TIM2"},
    {0x40000400, TIM, 3, APB1, 1, "TIM3"},
    {0x40000800, TIM, 4, APB1, 2, "TIM4"},
    {0x40000C00, TIM, 5, APB1, 3, "TIM5"},
    {0x40001000, TIM, 6, APB1, 4, "TIM6"},
    {0x40001400, TIM, 7, APB1, 5, "TIM7"},
    {0x40001800, UNMODELLED, 0, APB1, 6, "TIM12"},
    {0x40001C00, UNMODELLED, 0, APB1, 7, "TIM13"},
    {0x40002000, UNMODELLED, 0, APB1, 8, "TIM14"},
    {0x40002800, UNMODELLED, 0, ALWAYS, 0, "RTC"},
    {0x40002C00, UNMODELLED, 0, APB1, 11, "WWDG"},
    {0x40003000, IWDG, 0, ALWAYS, 0, "IWDG"},
    {0x40003800, UNMODELLED, 0, APB1, 14, "SPI2"},
    {0x40003C00, UNMODELLED, 0, APB1, 15, "SPI3"},
    {0x40004400, UNMODELLED, 0, APB1, 17, "USART2"},
    {0x40004800, UNMODELLED, 0, APB1, 18, "USART3"},
    {0x40004C00, UNMODELLED, 0, APB1, 19, "UART4"},
    {0x40005000, UNMODELLED, 0, APB1, 20, "UART5"},
    {0x40005400, UNMODELLED, 0, APB1, 21, "I2C1"},
    {0x40005800, UNMODELLED, 0, APB1, 22, "I2C2"},
    {0x40005C00, UNMODELLED, 0, APB1, 23, "I2C3"},
    {0x40006400, CAN, 0, APB1, 25, "CAN1"},
    {0x40006800, UNMODELLED, 0, APB1, 26, "CAN2"},
    {0x40007000, PWR, 0, APB1, 28, "PWR"},
    {0x40007400, UNMODELLED, 0, APB1, 29, "DAC"},
    {0x40010000, TIM, 1, APB2, 0, "TIM1"},
    {0x40010400, TIM, 8, APB2, 1, "TIM8"},
    {0x40011000, UNMODELLED, 0, APB2, 4, "USART1"},
    {0x40011400, UNMODELLED, 0, APB2, 5, "USART6"},
    {0x40012000, ADC, 0, ALWAYS, 0, "ADC"},
    {0x40012C00, UNMODELLED, 0, APB2, 11, "SDIO"},
    {0x40013000, UNMODELLED, 0, APB2, 12, "SPI1"},
    {0x40013800, SYSCFG, 0, APB2, 14, "SYSCFG"},
    {0x40013C00, EXTI, 0, ALWAYS, 0, "EXTI"},
    {0x40014000, UNMODELLED, 0, APB2, 16, "TIM9"},
    {0x40014400, UNMODELLED, 0, APB2, 17, "TIM10"},
    {0x40014800, UNMODELLED, 0, APB2, 18, "TIM11"},
    {0x40020000, GPIO, 0, AHB1, 0, "GPIOA"},
    {0x40020400, GPIO, 1, AHB1, 1, "GPIOB"},
    {0x40020800, GPIO, 2, AHB1, 2, "GPIOC"},
    {0x40020C00, GPIO, 3, AHB1, 3, "GPIOD"},
    {0x40021000, GPIO, 4, AHB1, 4, "GPIOE"},
    {0x40021400, GPIO, 5, AHB1, 5, "GPIOF"},
    {0x40021800, GPIO, 6, AHB1, 6, "GPIOG"},
    {0x40021C00, GPIO, 7, AHB1, 7, "GPIOH"},
    {0x40022000, GPIO, 8, AHB1, 8, "GPIOI"},
    {0x40023000, CRC, 0, AHB1, 12, "CRC"},
    {0x40023800, RCC, 0, ALWAYS, 0, "RCC"},
    {0x40023C00, FLASH, 0, ALWAYS, 0, "FLASH"},
    {0x40024000, BACKUP, 0, AHB1, 18, "BKPSRAM"},
    {0x40026000, UNMODELLED, 0, AHB1, 21, "DMA1"},
    {0x40026400, UNMODELLED, 0, AHB1, 22, "DMA2"},
};

static const block_t *block_of[512]; /* by address / 1 KiB; the same for every machine */

/* The access is abandoned on its instruction, so the fault is precise. */
static void access_fault(machine_t *m, int exception, uint32_t cfsr, uint32_t address) {
    if (!m->peeking) {
        m->fault = (fault_t){true, exception, cfsr, address, true};
        uc_emu_stop(m->cpu.uc);
    }
}

void bus_fault(machine_t *m, uint32_t address) {
    access_fault(m, BUS_FAULT, 1u << 9, address);
}

static bool mpu_refuses(machine_t *m, uint32_t address, int access) {
    if (!m->mpu.active || mpu_permits(m, address, access)) {
        return false;
    }
    access_fault(m, MEM_MANAGE, 1u << 1, address);
    return true;
}

static const block_t *find_block(uint32_t offset) {
    uint32_t index = offset >> 10;
    if (index >= 0x24000 >> 10 && index < 0x25000 >> 10) {
        index = 0x24000 >> 10; /* backup SRAM is 4 KiB long */
    }
    return index < 512 ? block_of[index] : NULL;
}

static bool clocked(const machine_t *m, const block_t *block) {
    return block->bus == ALWAYS || (m->rcc.enable[block->bus] >> block->enable_bit & 1u);
}

static void check_fresh(machine_t *m, const block_t *block) {
    if (block->bus != ALWAYS && rcc_is_fresh(m, block->bus, block->enable_bit) && !m->peeking) {
        note(m, "%s used right after its clock was enabled", block->name);
    }
}

static uint32_t read_block(machine_t *m, const block_t *block, uint32_t offset) {
    uint32_t value = 0;
    switch (block->kind) {
    case TIM:
        return tim_read(m, block->instance, offset);
    case ADC:
        return adc_read(m, offset);
    case CAN:
        return bxcan_read(m, offset);
    case GPIO:
        return gpio_read(m, block->instance, offset);
    case RCC:
        return rcc_read(m, offset);
    case FLASH:
        return flash_read(m, offset);
    case PWR:
        return pwr_read(m, offset);
    case IWDG:
        return iwdg_read(m, offset);
    case EXTI:
        return exti_read(m, offset);
    case SYSCFG:
        return syscfg_read(m, offset);
    case CRC:
        return crc_read(m, offset);
    case BACKUP:
        memcpy(&value, m->pwr.backup + (offset & 0xFFCu), 4);
        return value;
    default:
        unmodelled(m, "%s is not modelled", block->name);
        return 0;
    }
}

static void write_block(machine_t *m, const block_t *block, uint32_t offset, uint32_t value) {
    switch (block->kind) {
    case TIM:
        tim_write(m, block->instance, offset, value);
        break;
    case ADC:
        adc_write(m, offset, value);
        break;
    case CAN:
        bxcan_write(m, offset, value);
        break;
    case GPIO:
        gpio_write(m, block->instance, offset, value);
        break;
    case RCC:
        rcc_write(m, offset, value);
        break;
    case FLASH:
        flash_write(m, offset, value);
        break;
    case PWR:
        pwr_write(m, offset, value);
        break;
    case IWDG:
        iwdg_write(m, offset, value);
        break;
    case EXTI:
        exti_write(m, offset, value);
        break;
    case SYSCFG:
        syscfg_write(m, offset, value);
        break;
    case CRC:
        crc_write(m, offset, value);
        break;
    case BACKUP:
        if (m->pwr.cr & 1u << 8) { /* DBP */
            memcpy(m->pwr.backup + (offset & 0xFFCu), &value, 4);
        }
        break;
    default:
        unmodelled(m, "%s is not modelled", block->name);
        break;
    }
}

static uint64_t read_peripheral(uc_engine *uc, uint64_t offset64, unsigned size, void *user) {
    machine_t *m = user;
    uint32_t offset = (uint32_t)offset64;
    const block_t *block = find_block(offset);
    (void)uc;
    if (mpu_refuses(m, 0x40000000u + offset, ACCESS_READ)) {
        return 0;
    }
    if (block == NULL) {
        bus_fault(m, 0x40000000u + offset);
        return 0;
    }
    if (!clocked(m, block)) {
        return 0;
    }
    check_fresh(m, block);
    if (m->now >= m->next_event) { /* the register as it is now, in the middle of a block */
        events_run(m);
    }
    uint32_t value = read_block(m, block, (0x40000000u + offset - block->base) & ~3u);
    value >>= 8 * (offset & 3u);
    return size == 4 ? value : value & ((1u << (8 * size)) - 1);
}

static void write_peripheral(uc_engine *uc, uint64_t offset64, unsigned size, uint64_t value64,
                             void *user) {
    machine_t *m = user;
    uint32_t offset = (uint32_t)offset64;
    uint32_t value = (uint32_t)value64;
    const block_t *block = find_block(offset);
    (void)uc;
    if (mpu_refuses(m, 0x40000000u + offset, ACCESS_WRITE)) {
        return;
    }
    if (block == NULL) {
        bus_fault(m, 0x40000000u + offset);
        return;
    }
    if (!clocked(m, block)) {
        note(m, "%s written while its clock is off", block->name);
        return;
    }
    check_fresh(m, block);
    if (m->now >= m->next_event) {
        events_run(m);
    }
    uint32_t at = (0x40000000u + offset - block->base) & ~3u;
    if (size < 4) {
        uint32_t mask = (1u << (8 * size)) - 1;
        value &= mask;
        if (offset < 0x20000) { /* APB */
            value *= size == 1 ? 0x01010101u : 0x00010001u;
        } else {
            bool was = m->peeking;
            m->peeking = true;
            uint32_t shift = 8 * (offset & 3u);
            value = (read_block(m, block, at) & ~(mask << shift)) | value << shift;
            m->peeking = was;
        }
    }
    write_block(m, block, at, value);
}

/* The private peripheral bus: system control space, cycle counter, debug identification. */
static uint64_t read_core(uc_engine *uc, uint64_t offset64, unsigned size, void *user) {
    machine_t *m = user;
    uint32_t offset = (uint32_t)offset64 & ~3u;
    uint32_t value = 0;
    (void)uc;
    if (offset >= 0xE000 && offset < 0xF000) {
        value = scs_read(m, offset - 0xE000);
    } else if (offset >= 0x1000 && offset < 0x2000) {
        value = systick_read(m, offset);
    } else if (offset >= 0x42000 && offset < 0x42010) {
        value = debug_read(m, offset - 0x42000);
    }
    value >>= 8 * (offset64 & 3u);
    return size == 4 ? value : value & ((1u << (8 * size)) - 1);
}

static void write_core(uc_engine *uc, uint64_t offset64, unsigned size, uint64_t value,
                       void *user) {
    machine_t *m = user;
    uint32_t offset = (uint32_t)offset64;
    (void)uc;
    if (offset >= 0xE000 && offset < 0xF000) {
        scs_write(m, offset - 0xE000, (uint32_t)value, size);
    } else if (offset >= 0x1000 && offset < 0x2000) {
        systick_write(m, offset, (uint32_t)value);
    } else if (offset >= 0x42000 && offset < 0x42010) {
        debug_write(m, offset - 0x42000, (uint32_t)value);
    }
}

void bus_map(machine_t *m) {
    for (size_t i = 0; i < sizeof BLOCKS / sizeof BLOCKS[0]; i++) {
        block_of[(BLOCKS[i].base - 0x40000000u) >> 10] = &BLOCKS[i];
    }
    uc_mmio_map(m->cpu.uc, 0x40000000u, 0x80000, read_peripheral, m, write_peripheral, m);
    uc_mmio_map(m->cpu.uc, 0xE0000000u, 0x100000, read_core, m, write_core, m);
}

uint32_t machine_peek(machine_t *m, uint32_t address) {
    m->peeking = true;
    uint64_t value = address >= 0xE0000000u
                         ? read_core(m->cpu.uc, address - 0xE0000000u, 4, m)
                         : read_peripheral(m->cpu.uc, address - 0x40000000u, 4, m);
    m->peeking = false;
    return (uint32_t)value;
}
