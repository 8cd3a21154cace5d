//! The collocation method Radau IIA with seven stages, of order 13.
//!
//! Reference: E. Hairer, G. Wanner, *Solving Ordinary Differential Equations II* (1996), section IV.5. The numbers were computed from the
//! zeros of the 6th derivative of x^6 (x - 1)^7, with 60 digits.

/// How many stages there are.
pub(super) const STAGES: usize = 7;

/// Where the stages are; the last one is the end of the step.
pub(super) const NODES: [f64; STAGES] = [
    0.029_316_427_159_784_893,
    0.148_078_599_668_484_3,
    0.336_984_690_281_154_3,
    0.558_671_518_771_550_1,
    0.769_233_862_030_054_5,
    0.926_945_671_319_741_1,
    1.0,
];

/// The inverse of the matrix of the method: sum_j W_ij (Y_j - Y_0) = dt Y'_i.
pub(super) const WEIGHTS: [[f64; STAGES]; STAGES] = [
    [
        17.055_284_304_421_654,
        5.475_299_512_185_492,
        -1.618_581_105_190_787,
        0.749_654_128_238_506_6,
        -0.421_891_375_983_016,
        0.251_050_214_246_392_73,
        -0.092_324_819_353_684_13,
    ],
    [
        -12.948_988_698_811_522,
        3.376_585_145_452_422,
        4.054_013_503_925_586,
        -1.486_313_976_006_544_7,
        0.772_854_473_778_897_2,
        -0.444_946_947_201_07,
        0.161_774_700_335_381_4,
    ],
    [
        6.526_797_433_701_593,
        -6.912_304_925_481_829,
        1.483_746_931_004_011_4,
        3.594_603_354_455_891_5,
        -1.450_215_601_222_529_1,
        0.767_038_449_181_357_3,
        -0.271_428_485_619_872_43,
    ],
    [
        -4.760_415_643_167_771,
        3.990_860_318_095_922,
        -5.660_688_333_657_835,
        0.894_980_293_785_941_3,
        3.735_899_391_500_152,
        -1.541_978_502_549_350_4,
        0.511_712_657_099_715_6,
    ],
    [
        4.329_451_016_638_691,
        -3.353_528_001_677_918_5,
        3.690_617_931_862_721_7,
        -6.037_309_187_265_788,
        0.649_997_386_595_111_5,
        4.577_300_941_414_561,
        -1.244_056_646_677_253_4,
    ],
    [
        -4.943_623_833_507_561,
        3.704_802_676_027_051,
        -3.745_728_431_373_815_5,
        4.781_665_625_762_614_4,
        -8.783_388_755_925_044,
        0.539_405_938_740_858_3,
        5.443_680_188_059_144,
    ],
    [
        11.495_455_205_116_665,
        -8.517_072_423_056_625,
        8.381_031_301_964_825,
        -10.033_441_651_950_401,
        15.094_393_942_991_166,
        -34.420_366_375_065_63,
        25.0,
    ],
];

/// What makes of the shares w_j f(t_j) of an integral over a part, at the nodes, the two highest coefficients of the polynomial through the
/// values f(t_j), those of the Legendre polynomials of degree 5 and 6. This quadrature is exact for the products of these polynomials.
pub(super) const HIGHEST: [[f64; STAGES]; 2] = [legendre(5), legendre(6)];

/// What makes of the differences Y_j - Y_0 the two highest coefficients of dt Y'.
pub(super) const HIGHEST_RATES: [[f64; STAGES]; 2] = [
    of_equations(HIGHEST[0], false),
    of_equations(HIGHEST[1], false),
];

/// What makes of U, w times the gradient at the nodes, the two highest coefficients of dt Df^T U / w, where the part of the gradient at
/// the end has yet to be taken off.
pub(super) const HIGHEST_BACK: [[f64; STAGES]; 2] = [
    of_equations(HIGHEST[0], true),
    of_equations(HIGHEST[1], true),
];

/// A Legendre polynomial on the interval from 0 to 1, divided by the integral of its square, at the nodes.
const fn legendre(degree: u32) -> [f64; STAGES] {
    let mut out = [0.0; STAGES];
    let mut i = 0;
    while i < STAGES {
        let x = 2.0 * NODES[i] - 1.0;
        let (mut before, mut value, mut k) = (1.0, x, 1);
        while k < degree {
            let next = (2 * k + 1) as f64 * x * value - k as f64 * before;
            (before, value) = (value, next / (k + 1) as f64);
            k += 1;
        }
        out[i] = (2 * degree + 1) as f64 * value;
        i += 1;
    }
    out
}

/// The sum of h_j w_j W_ji over j, or of h_j W_ij on the way back.
const fn of_equations(highest: [f64; STAGES], is_back: bool) -> [f64; STAGES] {
    let mut out = [0.0; STAGES];
    let mut place = 0;
    while place < STAGES * STAGES {
        let (i, j) = (place / STAGES, place % STAGES);
        out[i] += match is_back {
            true => highest[j] * WEIGHTS[i][j],
            false => highest[j] * INTEGRALS[STAGES - 1][j] * WEIGHTS[j][i],
        };
        place += 1;
    }
    out
}

/// The matrix of the method: Y_i = Y_0 + dt sum_j C_ij Y'_j.
pub(super) const INTEGRALS: [[f64; STAGES]; STAGES] = [
    [
        0.03754626499392133,
        -0.0140393345564604,
        0.0103527896007423,
        -0.008158322540275011,
        0.006388413879534685,
        -0.004602326779148656,
        0.0018289425614706437,
    ],
    [
        0.08014759651561897,
        0.08106206398589154,
        -0.021237992120711036,
        0.014000291238817119,
        -0.010234185730090163,
        0.0071534651513645905,
        -0.0028126393724067235,
    ],
    [
        0.0720638469418819,
        0.17106835498388662,
        0.10961456404007211,
        -0.024619871728984055,
        0.014760377043950817,
        -0.009575259396791401,
        0.0036726783971383057,
    ],
    [
        0.07570512581982441,
        0.15409015514217114,
        0.2271077366732024,
        0.11747818703702478,
        -0.023810827153044174,
        0.012709985533661206,
        -0.004608844281289633,
    ],
    [
        0.07391234216319184,
        0.16135560761594242,
        0.2068672415521042,
        0.23700711534269422,
        0.10308679353381345,
        -0.018854139152580447,
        0.0058589009748887914,
    ],
    [
        0.07470556205979623,
        0.1583072238724687,
        0.21415342326720002,
        0.21987784703186003,
        0.19875212168063527,
        0.06926550160550914,
        -0.00811600819772829,
    ],
    [
        0.07449423555601031,
        0.15910211573365074,
        0.21235188950297781,
        0.22355491450728324,
        0.19047493682211558,
        0.1196137446126562,
        0.02040816326530612,
    ],
];
