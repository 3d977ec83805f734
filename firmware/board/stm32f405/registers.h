/* registers.h: the registers of the STM32F405 that this board uses, under the manuals' names.
 *
 * RM0090 (STM32F405/407 reference manual) for the peripherals, PM0214 (Cortex-M4 programming
 * manual) for the core. Only what is used is defined, each register and bit once. Addresses:
 * RM0090 table 1. Nothing but definitions: what to do with them is each driver's own business.
 */
#ifndef BOWDEN_STM32F405_REGISTERS_H
#define BOWDEN_STM32F405_REGISTERS_H

#include <stdint.h>

#define REGISTERS(type, address) ((volatile type *)(address))

/* ---- CRC calculation unit, RM0090 chapter 4 ---- */
typedef struct {
    uint32_t DR, IDR, CR;
} crc_registers_t;
#define CRC REGISTERS(crc_registers_t, 0x40023000u)
#define CRC_CR_RESET (1u << 0)

/* ---- RCC, RM0090 chapter 7 ---- */
typedef struct {
    uint32_t CR, PLLCFGR, CFGR, CIR, AHB1RSTR, AHB2RSTR, AHB3RSTR, reserved0, APB1RSTR, APB2RSTR;
    uint32_t reserved1[2], AHB1ENR, AHB2ENR, AHB3ENR, reserved2, APB1ENR, APB2ENR, reserved3[10];
    uint32_t BDCR, CSR;
} rcc_registers_t;
#define RCC REGISTERS(rcc_registers_t, 0x40023800u)
#define RCC_CR_HSEON (1u << 16)
#define RCC_CR_HSERDY (1u << 17)
#define RCC_CR_CSSON (1u << 19)
#define RCC_CR_PLLON (1u << 24)
#define RCC_CR_PLLRDY (1u << 25)
#define RCC_PLLCFGR_PLLM(value) (value)
#define RCC_PLLCFGR_PLLN(value) ((value) << 6)
#define RCC_PLLCFGR_PLLP_2 (0u << 16)
#define RCC_PLLCFGR_PLLSRC_HSE (1u << 22)
#define RCC_PLLCFGR_PLLQ(value) ((value) << 24)
#define RCC_CFGR_SW_PLL 2u
#define RCC_CFGR_SWS (3u << 2)
#define RCC_CFGR_SWS_PLL (2u << 2)
#define RCC_CFGR_PPRE1_DIV4 (5u << 10)
#define RCC_CFGR_PPRE2_DIV2 (4u << 13)
#define RCC_AHB1ENR_GPIOAEN (1u << 0)
#define RCC_AHB1ENR_GPIOBEN (1u << 1)
#define RCC_AHB1ENR_GPIOCEN (1u << 2)
#define RCC_AHB1ENR_CRCEN (1u << 12)
#define RCC_APB1ENR_TIM3EN (1u << 1)
#define RCC_APB1ENR_TIM4EN (1u << 2)
#define RCC_APB1ENR_CAN1EN (1u << 25)
#define RCC_APB1ENR_PWREN (1u << 28)
#define RCC_APB2ENR_TIM1EN (1u << 0)
#define RCC_APB2ENR_ADC1EN (1u << 8)
#define RCC_APB2ENR_SYSCFGEN (1u << 14)
#define RCC_CSR_RMVF (1u << 24)
#define RCC_CSR_BORRSTF (1u << 25)
#define RCC_CSR_PINRSTF (1u << 26)
#define RCC_CSR_PORRSTF (1u << 27)
#define RCC_CSR_SFTRSTF (1u << 28)
#define RCC_CSR_IWDGRSTF (1u << 29)
#define RCC_CSR_WWDGRSTF (1u << 30)
#define RCC_CSR_LPWRRSTF (1u << 31)

/* ---- PWR, chapter 5 ---- */
typedef struct {
    uint32_t CR, CSR;
} pwr_registers_t;
#define PWR REGISTERS(pwr_registers_t, 0x40007000u)
#define PWR_CR_PVDE (1u << 4)
#define PWR_CR_PLS_2V9 (7u << 5)
#define PWR_CR_VOS (1u << 14)
#define PWR_CSR_PVDO (1u << 2)

/* ---- Flash interface, chapter 3 ---- */
typedef struct {
    uint32_t ACR, KEYR, OPTKEYR, SR, CR, OPTCR;
} flash_registers_t;
#define FLASH REGISTERS(flash_registers_t, 0x40023C00u)
#define FLASH_ACR_LATENCY(wait_states) (wait_states)
#define FLASH_ACR_LATENCY_MASK 7u
#define FLASH_ACR_PRFTEN (1u << 8)
#define FLASH_ACR_ICEN (1u << 9)
#define FLASH_ACR_DCEN (1u << 10)
#define FLASH_ACR_DCRST (1u << 12)
#define FLASH_KEYR_KEY1 0x45670123u
#define FLASH_KEYR_KEY2 0xCDEF89ABu
#define FLASH_SR_ERRORS (1u << 1 | 1u << 4 | 1u << 5 | 1u << 6 | 1u << 7)
#define FLASH_SR_BSY (1u << 16)
#define FLASH_CR_PG (1u << 0)
#define FLASH_CR_SER (1u << 1)
#define FLASH_CR_SNB(sector) ((sector) << 3)
#define FLASH_CR_PSIZE_WORD (2u << 8)
#define FLASH_CR_STRT (1u << 16)
#define FLASH_CR_LOCK (1u << 31)

/* ---- GPIO, chapter 8; SYSCFG, chapter 9; EXTI, chapter 12 ---- */
typedef struct {
    uint32_t MODER, OTYPER, OSPEEDR, PUPDR, IDR, ODR, BSRR, LCKR, AFR[2];
} gpio_registers_t;
#define GPIOA REGISTERS(gpio_registers_t, 0x40020000u)
#define GPIOB REGISTERS(gpio_registers_t, 0x40020400u)
#define GPIOC REGISTERS(gpio_registers_t, 0x40020800u)
typedef struct {
    uint32_t MEMRMP, PMC, EXTICR[4];
} syscfg_registers_t;
#define SYSCFG REGISTERS(syscfg_registers_t, 0x40013800u)
typedef struct {
    uint32_t IMR, EMR, RTSR, FTSR, SWIER, PR;
} exti_registers_t;
#define EXTI REGISTERS(exti_registers_t, 0x40013C00u)
#define EXTI_PVD (1u << 16)

/* ---- Timers, chapters 17 (TIM1) and 18 (TIM3, TIM4) ---- */
typedef struct {
    uint32_t CR1, CR2, SMCR, DIER, SR, EGR, CCMR1, CCMR2, CCER, CNT, PSC, ARR, RCR;
    uint32_t CCR1, CCR2, CCR3, CCR4, BDTR;
} tim_registers_t;
#define TIM1 REGISTERS(tim_registers_t, 0x40010000u)
#define TIM3 REGISTERS(tim_registers_t, 0x40000400u)
#define TIM4 REGISTERS(tim_registers_t, 0x40000800u)
#define TIM_CR1_CEN (1u << 0)
#define TIM_CR1_CMS_1 (1u << 5)
#define TIM_CR1_ARPE (1u << 7)
#define TIM_CR2_MMS_UPDATE (2u << 4)
#define TIM_SMCR_SMS_ENCODER_3 3u
#define TIM_SR_BIF (1u << 7)
#define TIM_EGR_UG (1u << 0)
#define TIM_CCMR1_OC1PE (1u << 3)
#define TIM_CCMR1_OC1M_PWM1 (6u << 4)
#define TIM_CCMR1_OC2PE (1u << 11)
#define TIM_CCMR1_OC2M_PWM1 (6u << 12)
#define TIM_CCMR1_CC1S_TI1 (1u << 0)
#define TIM_CCMR1_IC1F(value) ((value) << 4)
#define TIM_CCMR1_CC2S_TI2 (1u << 8)
#define TIM_CCMR1_IC2F(value) ((value) << 12)
#define TIM_CCER_CC1E (1u << 0)
#define TIM_CCER_CC1NE (1u << 2)
#define TIM_CCER_CC2E (1u << 4)
#define TIM_CCER_CC2NE (1u << 6)
#define TIM_BDTR_DTG(value) (value)
#define TIM_BDTR_LOCK_1 (1u << 8)
#define TIM_BDTR_OSSI (1u << 10)
#define TIM_BDTR_OSSR (1u << 11)
#define TIM_BDTR_BKE (1u << 12)
#define TIM_BDTR_MOE (1u << 15)

/* ---- ADC, chapter 13 ---- */
typedef struct {
    uint32_t SR, CR1, CR2, SMPR1, SMPR2, JOFR[4], HTR, LTR, SQR[3], JSQR, JDR[4], DR;
} adc_registers_t;
#define ADC1 REGISTERS(adc_registers_t, 0x40012000u)
typedef struct {
    uint32_t CSR, CCR;
} adc_common_registers_t;
#define ADC_COMMON REGISTERS(adc_common_registers_t, 0x40012300u)
#define ADC_SR_JEOC (1u << 2)
#define ADC_CR1_JEOCIE (1u << 7)
#define ADC_CR1_SCAN (1u << 8)
#define ADC_CR2_ADON (1u << 0)
#define ADC_CR2_JEXTSEL_TIM1_TRGO (1u << 16)
#define ADC_CR2_JEXTEN_RISING (1u << 20)
#define ADC_SMPR_28_CYCLES 2u
#define ADC_JSQR_JL(conversions) (((conversions) - 1u) << 20)
#define ADC_JSQR_JSQ(rank, channel) ((channel) << (5u * ((rank) - 1u)))
#define ADC_CCR_ADCPRE_DIV4 (1u << 16)

/* ---- bxCAN, chapter 32 ---- */
typedef struct {
    uint32_t TIR, TDTR, TDLR, TDHR;
} can_mailbox_registers_t;
typedef struct {
    uint32_t RIR, RDTR, RDLR, RDHR;
} can_fifo_registers_t;
typedef struct {
    uint32_t MCR, MSR, TSR, RF0R, RF1R, IER, ESR, BTR, reserved0[88];
    can_mailbox_registers_t MAILBOX[3];
    can_fifo_registers_t FIFO[2];
    uint32_t reserved1[12], FMR, FM1R, reserved2, FS1R, reserved3, FFA1R, reserved4, FA1R;
    uint32_t reserved5[8], FILTER[28][2];
} can_registers_t;
#define CAN1 REGISTERS(can_registers_t, 0x40006400u)
#define CAN_MCR_INRQ (1u << 0)
#define CAN_MCR_TXFP (1u << 2)
#define CAN_MCR_DBF (1u << 16)
#define CAN_MSR_INAK (1u << 0)
#define CAN_TSR_RQCP (1u << 0 | 1u << 8 | 1u << 16)
#define CAN_TSR_TXOK (1u << 1 | 1u << 9 | 1u << 17)
#define CAN_TSR_ABRQ (1u << 7 | 1u << 15 | 1u << 23)
#define CAN_TSR_CODE(tsr) (((tsr) >> 24) & 3u)
#define CAN_TSR_TME (7u << 26)
#define CAN_TSR_TME0 (1u << 26)
#define CAN_RF0R_FMP0 3u
#define CAN_RF0R_FOVR0 (1u << 4)
#define CAN_RF0R_RFOM0 (1u << 5)
#define CAN_IER_FMPIE0 (1u << 1)
#define CAN_ESR_EPVF (1u << 1)
#define CAN_ESR_BOFF (1u << 2)
#define CAN_BTR_BRP(divider) ((divider) - 1u)
#define CAN_BTR_TS1(quanta) (((quanta) - 1u) << 16)
#define CAN_BTR_TS2(quanta) (((quanta) - 1u) << 20)
#define CAN_BTR_SJW(quanta) (((quanta) - 1u) << 24)
#define CAN_TIR_TXRQ (1u << 0)
#define CAN_IR_STID(identifier) ((uint32_t)(identifier) << 21)
#define CAN_RIR_STID(rir) ((rir) >> 21)
#define CAN_DTR_DLC 15u
#define CAN_FMR_FINIT (1u << 0)
#define CAN_FMR_RESET 0x2A1C0E00u /* with CAN2SB as after reset */

/* ---- IWDG, chapter 21 ---- */
typedef struct {
    uint32_t KR, PR, RLR, SR;
} iwdg_registers_t;
#define IWDG REGISTERS(iwdg_registers_t, 0x40003000u)
#define IWDG_KR_RELOAD 0xAAAAu
#define IWDG_KR_ACCESS 0x5555u
#define IWDG_KR_START 0xCCCCu
#define IWDG_PR_DIV4 0u

/* ---- Debug support, chapter 38; unique id, chapter 39 ---- */
typedef struct {
    uint32_t IDCODE, CR, APB1_FZ, APB2_FZ;
} dbgmcu_registers_t;
#define DBGMCU REGISTERS(dbgmcu_registers_t, 0xE0042000u)
#define DBGMCU_APB1_FZ_IWDG_STOP (1u << 12)
#define DBGMCU_APB2_FZ_TIM1_STOP (1u << 0)
#define UNIQUE_ID REGISTERS(uint32_t, 0x1FFF7A10u) /* three words */

/* ---- Core, PM0214 chapter 4 ---- */
typedef struct {
    uint32_t CTRL, LOAD, VAL, CALIB;
} systick_registers_t;
#define SYSTICK REGISTERS(systick_registers_t, 0xE000E010u)
#define SYSTICK_CTRL_ENABLE (1u << 0)
#define SYSTICK_CTRL_TICKINT (1u << 1)
#define SYSTICK_CTRL_CLKSOURCE (1u << 2)
#define SYSTICK_CTRL_COUNTFLAG (1u << 16)
#define NVIC_ISER REGISTERS(uint32_t, 0xE000E100u)
#define NVIC_IPR REGISTERS(uint8_t, 0xE000E400u) /* one byte an interrupt */
typedef struct {
    uint32_t CPUID, ICSR, VTOR, AIRCR, SCR, CCR;
    uint8_t SHPR[12]; /* priority of exception n at n - 4 */
    uint32_t SHCSR, CFSR, HFSR, DFSR, MMFAR, BFAR;
} scb_registers_t;
#define SCB REGISTERS(scb_registers_t, 0xE000ED00u)
#define SCB_ICSR_PENDSVSET (1u << 28)
#define SCB_AIRCR_VECTKEY (0x05FAu << 16)
#define SCB_AIRCR_SYSRESETREQ (1u << 2)
#define SCB_CCR_DIV_0_TRP (1u << 4)
typedef struct {
    uint32_t TYPE, CTRL, RNR, RBAR, RASR;
} mpu_registers_t;
#define MPU REGISTERS(mpu_registers_t, 0xE000ED90u)
#define MPU_CTRL_ENABLE (1u << 0)
#define MPU_RASR_ENABLE (1u << 0)
#define MPU_RASR_SIZE(log2_bytes) (((log2_bytes) - 1u) << 1)
#define MPU_RASR_BUFFERABLE (1u << 16)
#define MPU_RASR_CACHEABLE (1u << 17)
#define MPU_RASR_SHAREABLE (1u << 18)
#define MPU_RASR_NO_ACCESS (0u << 24)
#define MPU_RASR_READ_WRITE (3u << 24)
#define MPU_RASR_READ_ONLY (6u << 24)
#define MPU_RASR_XN (1u << 28)

#define EXCEPTION_PENDSV 14u
#define EXCEPTION_SYSTICK 15u
#define IRQ_PVD 1u
#define IRQ_ADC 18u
#define IRQ_CAN1_RX0 20u
#define IRQ_EXTI9_5 23u

/* All earlier stores have taken effect before the next instruction. */
static inline void core_barrier(void) {
    __asm volatile("dsb\n isb" ::: "memory");
}

/* The compiler moves no memory access across. */
static inline void core_order(void) {
    __asm volatile("" ::: "memory");
}

/* Keeps every interrupt out, for a few instructions; not nested. Faults and NMI still come. */
static inline void core_mask(void) {
    __asm volatile("cpsid i" ::: "memory");
}

static inline void core_unmask(void) {
    __asm volatile("cpsie i" ::: "memory");
}

/* The 32 bits in the opposite order. */
static inline uint32_t core_reversed(uint32_t word) {
    uint32_t reversed;
    __asm("rbit %0, %1" : "=r"(reversed) : "r"(word));
    return reversed;
}

static inline void core_sleep(void) {
    __asm volatile("wfi" ::: "memory");
}

#endif
