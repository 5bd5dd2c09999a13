"""Published coefficients of the homogeneous differentiator.

Levant and Livne (2020), Robust exact filtering differentiators, European Journal of Control 55, 33, doi
10.1016/j.ejcon.2019.08.006: λ̃_0 … λ̃_n for n = n_d + n_f = 0 … 12, rounded to about four digits. They are those of the
recursive form with λ = 1.1, 1.5, 2, 3, 5, 7, 10, 12, 14, 17, 20, 26, 32 (there too, and up to n = 5 in Levant (2003),
Higher-order sliding modes, differentiation and output-feedback control, Int. J. Control 76, 924), by
λ̃_n = λ_n and λ̃_j = λ_j·λ̃_(j+1)^(j/(j+1)).
"""

LONGEST = 12
TABLES = (
    (1.1,),
    (1.1, 1.5),
    (1.1, 2.12, 2.0),
    (1.1, 3.06, 4.16, 3.0),
    (1.1, 4.57, 9.30, 10.03, 5.0),
    (1.1, 6.75, 20.26, 32.24, 23.72, 7.0),
    (1.1, 9.91, 43.65, 101.96, 110.08, 47.69, 10.0),
    (1.1, 14.13, 88.78, 295.74, 455.40, 281.37, 84.14, 12.0),
    (1.1, 19.66, 171.73, 795.63, 1703.9, 1464.2, 608.99, 120.79, 14.0),
    (1.1, 26.93, 322.31, 2045.8, 6002.3, 7066.2, 4026.3, 1094.1, 173.72, 17.0),
    (1.1, 36.34, 586.78, 5025.4, 19895.0, 31601.0, 24296.0, 8908.0, 1908.5, 251.99, 20.0),
    (1.1, 48.86, 1061.1, 12220.0, 65053.0, 138954.0, 143658.0, 70830.0, 20406.0, 3623.1, 386.7, 26.0),
    (1.1, 65.22, 1890.6, 29064.0, 206531.0, 588869.0, 812652.0, 534837.0, 205679.0, 48747.0, 6944.8, 623.30, 32.0),
)
