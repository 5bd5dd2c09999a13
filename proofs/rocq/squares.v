(* Sums of squares b'Qb, checked in integers: polynomials, positive definite matrices, and the identity that proves.

   Everything that a certificate's identity needs is computed by [accepts] over Z; [accepts_sound] says once what its answer
   means for real numbers. Standard library alone. *)

From Coq Require Import ZArith QArith Qreals Reals List Lra Lia Psatz.
Import ListNotations.
Local Open Scope R_scope.

(* Whether one of a list will do; none after it is tried. *)
Fixpoint first {A : Type} (good : A -> bool) (l : list A) : bool :=
  match l with nil => false | a :: l => if good a then true else first good l end.

Lemma first_some {A : Type} good (l : list A) : first good l = true -> exists a, good a = true.
Proof. induction l as [| a l H]; cbn; [discriminate |]. destruct (good a) eqn:ok; [now exists a | exact H]. Qed.

(* ---------------------------------------------------------------- polynomials over Z *)

(* A polynomial in the variables k, k + 1, ...: [Horner inner more] is inner (k + 1, ...) + (variable k) * more (k, ...). *)
Inductive tree : Set := Zero | Constant (c : Z) | Horner (inner more : tree).

Fixpoint value (x : nat -> R) (k : nat) (t : tree) : R :=
  match t with
  | Zero => 0
  | Constant c => IZR c
  | Horner inner more => value x (S k) inner + x k * value x k more
  end.

Fixpoint add_constant (c : Z) (t : tree) : tree :=
  match t with
  | Zero => Constant c
  | Constant d => Constant (c + d)
  | Horner inner more => Horner (add_constant c inner) more
  end.

Fixpoint add (s t : tree) : tree :=
  match s, t with
  | Zero, _ => t
  | _, Zero => s
  | Constant c, _ => add_constant c t
  | _, Constant c => add_constant c s
  | Horner i m, Horner i' m' => Horner (add i i') (add m m')
  end.

Fixpoint scale (c : Z) (t : tree) : tree :=
  match t with
  | Zero => Zero
  | Constant d => Constant (c * d)
  | Horner inner more => Horner (scale c inner) (scale c more)
  end.

Definition shift (t : tree) : tree := match t with Zero => Zero | _ => Horner Zero t end.

Fixpoint mul (s t : tree) : tree :=
  match s with
  | Zero => Zero
  | Constant c => scale c t
  | Horner Zero more => shift (mul more t)
  | Horner inner more =>
      let fix within (t : tree) :=
        match t with
        | Zero => Zero
        | Constant c => Horner (scale c inner) Zero
        | Horner i m => Horner (mul inner i) (within m)
        end in
      add (within t) (shift (mul more t))
  end.

Fixpoint is_zero (t : tree) : bool :=
  match t with
  | Zero => true
  | Constant c => (c =? 0)%Z
  | Horner inner more => is_zero inner && is_zero more
  end.

(* The monomial with a coefficient and the exponents of the variables k, k + 1, ... *)
Fixpoint raised (e : nat) (t : tree) : tree := match e with O => t | S e => Horner Zero (raised e t) end.
Fixpoint monomial (c : Z) (exponents : list nat) : tree :=
  match exponents with
  | nil => Constant c
  | e :: rest => raised e (Horner (monomial c rest) Zero)
  end.
Fixpoint monomial_value (x : nat -> R) (k : nat) (exponents : list nat) : R :=
  match exponents with nil => 1 | e :: rest => x k ^ e * monomial_value x (S k) rest end.

Section Values.
Variable x : nat -> R.

Lemma value_add_constant c t : forall k, value x k (add_constant c t) = IZR c + value x k t.
Proof. induction t as [| d | i Hi m Hm]; intro k; cbn; [| rewrite plus_IZR | rewrite Hi]; ring. Qed.

Lemma value_add s : forall t k, value x k (add s t) = value x k s + value x k t.
Proof.
  induction s as [| c | i Hi m Hm]; intros [| d | i' m'] k; cbn -[add_constant];
    rewrite ?value_add_constant, ?Hi, ?Hm; cbn; try ring.
Qed.

Lemma value_scale c t : forall k, value x k (scale c t) = IZR c * value x k t.
Proof. induction t as [| d | i Hi m Hm]; intro k; cbn; rewrite ?mult_IZR, ?Hi, ?Hm; ring. Qed.

Lemma value_shift t k : value x k (shift t) = x k * value x k t.
Proof. destruct t; cbn; ring. Qed.

Lemma value_mul s : forall t k, value x k (mul s t) = value x k s * value x k t.
Proof.
  induction s as [| c | i Hi m Hm]; intros t k.
  - cbn; ring.
  - apply value_scale.
  - assert (within : forall t, value x k ((fix within (t : tree) :=
        match t with
        | Zero => Zero
        | Constant c => Horner (scale c i) Zero
        | Horner i' m' => Horner (mul i i') (within m')
        end) t) = value x (S k) i * value x k t).
    { clear t; induction t as [| d | i' Hi' m' Hm']; cbn.
      - ring.
      - rewrite value_scale; ring.
      - rewrite Hi, Hm'; ring. }
    destruct i as [| c | i i'].
    + cbn [mul]. rewrite value_shift, Hm. cbn; ring.
    + cbn [mul]. rewrite value_add, value_shift, Hm. cbn [mul] in within. rewrite within. cbn; ring.
    + cbn [mul]. rewrite value_add, value_shift, Hm. cbn [mul] in within. rewrite within. cbn; ring.
Qed.

Lemma value_is_zero t : forall k, is_zero t = true -> value x k t = 0.
Proof.
  induction t as [| c | i Hi m Hm]; intros k zero; cbn in *.
  - reflexivity.
  - now rewrite (proj1 (Z.eqb_eq _ _) zero).
  - apply andb_prop in zero as [zi zm]. rewrite (Hi _ zi), (Hm _ zm). ring.
Qed.

Lemma value_monomial c e : forall k, value x k (monomial c e) = IZR c * monomial_value x k e.
Proof.
  induction e as [| n e He]; intro k; cbn [monomial monomial_value].
  - cbn; ring.
  - induction n as [| n Hn]; cbn [raised value pow]; [| rewrite Hn]; rewrite ?He; cbn [value]; ring.
Qed.
End Values.

(* ---------------------------------------------------------------- positive definite matrices *)

(* The upper triangle of a symmetric matrix, row by row. *)
Definition matrix := list (list Z).

Fixpoint dot (row : list Z) (y : list R) : R :=
  match row, y with q :: row, v :: y => IZR q * v + dot row y | _, _ => 0 end.
Fixpoint quadratic (rows : matrix) (y : list R) : R :=
  match rows, y with
  | (d :: row) :: rows, v :: y => v * (IZR d * v + 2 * dot row y) + quadratic rows y
  | _, _ => 0
  end.
Fixpoint squared (y : list R) : R := match y with nil => 0 | v :: y => v * v + squared y end.
Fixpoint shaped (rows : matrix) : bool :=
  match rows with nil => true | row :: rows => Nat.eqb (length row) (S (length rows)) && shaped rows end.

Fixpoint zip (f : Z -> Z -> Z) (a b : list Z) : list Z :=
  match a, b with p :: a, q :: b => f p q :: zip f a b | _, _ => nil end.

(* What is left, times the pivot d, after a row (d, b) is eliminated. *)
Fixpoint eliminate (d : Z) (b : list Z) (rows : matrix) : matrix :=
  match rows, b with
  | row :: rows, e :: rest => zip (fun c f => d * c - e * f)%Z row b :: eliminate d rest rows
  | _, _ => nil
  end.

(* Fewer digits: entries divided by p and rounded down, for which the diagonal pays with the margin m. *)
Fixpoint rounded (p m : Z) (rows : matrix) : matrix :=
  match rows with
  | (d :: row) :: rows => (d / p - m :: map (fun q => q / p) row)%Z :: rounded p m rows
  | _ => nil
  end.
Definition largest (rows : matrix) : Z := fold_left (fun top row => Z.max top (hd 0%Z row)) rows 0%Z.
Definition shortened (bits : Z) (rows : matrix) : matrix :=
  let excess := (Z.log2 (largest rows) - bits)%Z in
  if (excess <=? 0)%Z then rows else rounded (2 ^ excess) (Z.of_nat (length rows)) rows.

Fixpoint definite (steps : nat) (bits : Z) (rows : matrix) : bool :=
  match rows, steps with
  | nil, _ => true
  | (d :: b) :: rest, S steps => (0 <? d)%Z && definite steps bits (shortened bits (eliminate d b rest))
  | _, _ => false
  end.

Lemma squared_nonnegative y : 0 <= squared y.
Proof. induction y; cbn; nra. Qed.

Lemma shaped_cons row rows : shaped (row :: rows) = true ->
  exists d b, row = d :: b /\ length b = length rows /\ shaped rows = true.
Proof.
  cbn [shaped]. intro H; apply andb_prop in H as [len sh]. apply Nat.eqb_eq in len.
  destruct row as [| d b]; cbn in len; [discriminate |]. exists d, b. repeat split; [lia | exact sh].
Qed.

Lemma dot_zip d e : forall row b y, length row = length b ->
  dot (zip (fun c f => d * c - e * f)%Z row b) y = IZR d * dot row y - IZR e * dot b y.
Proof.
  induction row as [| c row H]; intros [| f b] y len; try discriminate; cbn.
  - ring.
  - destruct y as [| v y]; [ring |]. rewrite H by (cbn in len; lia). rewrite minus_IZR, !mult_IZR. ring.
Qed.

Lemma length_zip f : forall a b, length a = length b -> length (zip f a b) = length a.
Proof. induction a as [| p a H]; intros [| q b] len; cbn in *; auto. Qed.

Lemma length_eliminate d : forall rows b, length b = length rows -> length (eliminate d b rows) = length rows.
Proof. induction rows as [| row rows H]; intros [| e b] len; cbn in *; auto. Qed.

Lemma shaped_eliminate d : forall rows b, length b = length rows -> shaped rows = true ->
  shaped (eliminate d b rows) = true.
Proof.
  induction rows as [| row rows H]; intros [| e b] len sh; try discriminate; cbn [eliminate]; [reflexivity |].
  destruct (shaped_cons _ _ sh) as (c & r & -> & lr & sr). cbn in len.
  cbn [shaped]. rewrite length_zip by (cbn; lia). rewrite length_eliminate by lia.
  cbn [length]. rewrite lr, Nat.eqb_refl. cbn. apply H; [lia | exact sr].
Qed.

Lemma quadratic_eliminate d : forall rows b y,
  shaped rows = true -> length b = length rows -> length y = length rows ->
  quadratic (eliminate d b rows) y = IZR d * quadratic rows y - dot b y * dot b y.
Proof.
  induction rows as [| row rows H]; intros [| e b] [| v y] sh lb ly; try discriminate.
  - cbn; ring.
  - destruct (shaped_cons _ _ sh) as (c & r & -> & lr & sr). cbn in lb, ly.
    cbn [eliminate zip quadratic dot]. rewrite H by (try lia; exact sr).
    rewrite dot_zip by lia. rewrite minus_IZR, !mult_IZR. ring.
Qed.

Lemma divided p q : (0 < p)%Z -> IZR p * IZR (q / p) <= IZR q <= IZR p * IZR (q / p) + IZR p.
Proof.
  intro pos. pose proof (Z.div_mod q p ltac:(lia)) as eq. pose proof (Z.mod_pos_bound q p pos) as bound.
  split; rewrite <- !mult_IZR, <- ?plus_IZR; apply IZR_le; lia.
Qed.

Lemma dot_divided p v : (0 < p)%Z -> forall row y, length y = length row ->
  IZR p * (2 * v * dot (map (fun q => (q / p)%Z) row) y - (INR (length row) * (v * v) + squared y)) <= 2 * v * dot row y.
Proof.
  intro pos. induction row as [| q row H]; intros [| w y] len; try discriminate.
  - cbn; lra.
  - cbn in len. specialize (H y ltac:(lia)). cbn [map dot squared].
    change (length (q :: row)) with (S (length row)). rewrite S_INR.
    destruct (divided p q pos) as [low high].
    set (s := IZR p * IZR (q / p)) in *. assert (pp : 0 < IZR p) by (apply IZR_lt; exact pos).
    assert (mixed : - (IZR p * (v * v + w * w)) <= 2 * v * ((IZR q - s) * w)).
    { pose proof (Rle_0_sqr (v + w)) as P. pose proof (Rle_0_sqr (v - w)) as M. unfold Rsqr in P, M. nra. }
    unfold s in mixed. lra.
Qed.

Lemma quadratic_rounded p m : (0 < p)%Z -> forall rows y, shaped rows = true -> length y = length rows ->
  IZR p * (quadratic (rounded p m rows) y + (IZR m - INR (length rows) + 1) * squared y) <= quadratic rows y.
Proof.
  intro pos. assert (pp : 0 < IZR p) by (apply IZR_lt; exact pos).
  induction rows as [| row rows H]; intros [| v y] sh ly; try discriminate.
  - cbn; lra.
  - destruct (shaped_cons _ _ sh) as (d & b & -> & lb & sr). cbn in ly.
    specialize (H y sr ltac:(lia)). cbn [rounded quadratic squared].
    change (length ((d :: b) :: rows)) with (S (length rows)). rewrite S_INR.
    pose proof (dot_divided p v pos b y ltac:(lia)) as D. rewrite lb in D.
    destruct (divided p d pos) as [low _]. rewrite minus_IZR. pose proof (Rle_0_sqr v) as V; unfold Rsqr in V.
    assert (diagonal : IZR p * IZR (d / p) * (v * v) <= IZR d * (v * v)) by (apply Rmult_le_compat_r; lra).
    lra.
Qed.

Lemma shaped_rounded p m : forall rows, shaped rows = true -> shaped (rounded p m rows) = true /\
  length (rounded p m rows) = length rows.
Proof.
  induction rows as [| row rows H]; intro sh; [easy |].
  destruct (shaped_cons _ _ sh) as (d & b & -> & lb & sr). destruct (H sr) as [s l].
  cbn [rounded]. split; [| cbn; lia]. cbn [shaped length]. rewrite map_length, l, lb, Nat.eqb_refl. exact s.
Qed.

Lemma definite_sound bits : forall steps rows y, definite steps bits rows = true -> shaped rows = true ->
  length y = length rows -> 0 <= quadratic rows y.
Proof.
  induction steps as [| steps H]; intros rows y good sh ly.
  - destruct rows as [| [| d b] rows]; cbn in *; try discriminate. lra.
  - destruct rows as [| row rows]; [cbn; lra |].
    destruct (shaped_cons _ _ sh) as (d & b & -> & lb & sr). cbn [definite] in good.
    apply andb_prop in good as [pd rest]. apply Z.ltb_lt in pd. apply IZR_lt in pd.
    destruct y as [| v y]; [discriminate |]. cbn in ly.
    assert (schur : 0 <= quadratic (eliminate d b rows) y).
    { pose proof (length_eliminate d rows b lb) as le. pose proof (shaped_eliminate d rows b lb sr) as se.
      unfold shortened in rest. destruct (Z.log2 _ - bits <=? 0)%Z eqn:few.
      - apply H; auto; lia.
      - set (p := (2 ^ _)%Z) in *. set (m := Z.of_nat _) in *.
        assert (pos : (0 < p)%Z) by (apply Z.pow_pos_nonneg; apply Z.leb_gt in few; lia).
        destruct (shaped_rounded p m _ se) as [s l].
        pose proof (H _ y rest s ltac:(lia)) as small.
        pose proof (quadratic_rounded p m pos _ y se ltac:(lia)) as Q.
        assert (margin : IZR m = INR (length (eliminate d b rows))) by (unfold m; now rewrite <- INR_IZR_INZ).
        rewrite margin in Q. pose proof (squared_nonnegative y). assert (0 < IZR p) by now apply IZR_lt.
        apply Rle_trans with (2 := Q). apply Rmult_le_pos; lra. }
    rewrite quadratic_eliminate in schur by (auto; lia).
    cbn [quadratic]. pose proof (Rle_0_sqr (IZR d * v + dot b y)) as S; unfold Rsqr in S.
    apply Rmult_le_reg_l with (IZR d); [exact pd |]. lra.
Qed.

(* ---------------------------------------------------------------- squares *)

(* The product of some of the constraints, by their indices, times b'Qb with monomials b. *)
Record square : Set := Square { product : list nat; basis : list tree; gram : matrix }.

Fixpoint combined (row : list Z) (b : list tree) : tree :=
  match row, b with q :: row, t :: b => add (scale q t) (combined row b) | _, _ => Zero end.
Fixpoint expanded (rows : matrix) (b : list tree) : tree :=
  match rows, b with
  | (d :: row) :: rows, t :: b => add (mul t (add (scale d t) (scale 2 (combined row b)))) (expanded rows b)
  | _, _ => Zero
  end.
Definition factors (constraints : list tree) (chosen : list nat) : tree :=
  fold_right (fun i t => mul (nth i constraints Zero) t) (Constant 1) chosen.
Definition square_definite (s : square) : bool :=
  shaped (gram s) && Nat.eqb (length (basis s)) (length (gram s)) &&
  first (fun bits => definite (length (gram s)) bits (gram s)) [48; 96; 192; 384; 768; 1536; 3072; 6144]%Z.
Definition sum_of (constraints : list tree) (squares : list square) : tree :=
  fold_right (fun s t => add (mul (factors constraints (product s)) (expanded (gram s) (basis s))) t) Zero squares.
Definition combination (cofactors equalities : list tree) : tree :=
  fold_right (fun p t => add (mul (fst p) (snd p)) t) Zero (combine cofactors equalities).

Section Squares.
Variable x : nat -> R.

Lemma value_combined : forall row b, value x 0 (combined row b) = dot row (map (value x 0) b).
Proof.
  induction row as [| q row H]; intros [| t b]; cbn; try reflexivity. now rewrite value_add, value_scale, H.
Qed.

Lemma value_expanded : forall rows b, value x 0 (expanded rows b) = quadratic rows (map (value x 0) b).
Proof.
  induction rows as [| [| d row] rows H]; intros [| t b]; cbn; try reflexivity.
  rewrite value_add, value_mul, value_add, !value_scale, value_combined, H. ring.
Qed.

Lemma value_factors constraints chosen :
  Forall (fun g => 0 <= value x 0 g) constraints -> 0 <= value x 0 (factors constraints chosen).
Proof.
  intro all. induction chosen as [| i chosen H]; cbn; [lra |]. rewrite value_mul. apply Rmult_le_pos; [| exact H].
  destruct (nth_in_or_default i constraints Zero) as [here | ->]; [| cbn; lra].
  exact (proj1 (Forall_forall _ _) all _ here).
Qed.

Lemma value_sum_of constraints squares : forallb square_definite squares = true ->
  Forall (fun g => 0 <= value x 0 g) constraints -> 0 <= value x 0 (sum_of constraints squares).
Proof.
  intros good all. induction squares as [| s squares H]; cbn; [lra |].
  cbn in good. apply andb_prop in good as [one rest]. rewrite value_add, value_mul, value_expanded.
  unfold square_definite in one. apply andb_prop in one as [one pd]. apply andb_prop in one as [sh len].
  apply first_some in pd as [bits pd].
  apply Nat.eqb_eq in len. apply Rplus_le_le_0_compat; [| exact (H rest)]. apply Rmult_le_pos.
  - now apply value_factors.
  - eapply definite_sound; eauto. rewrite map_length. exact len.
Qed.

Lemma value_combination cofactors : forall equalities,
  Forall (fun h => value x 0 h = 0) equalities -> value x 0 (combination cofactors equalities) = 0.
Proof.
  unfold combination. induction cofactors as [| q cofactors H]; intros [| h equalities] all; cbn; try reflexivity.
  inversion all as [| ? ? zero rest]; subst. rewrite value_add, value_mul, zero. unfold combination in H.
  rewrite (H _ rest). ring.
Qed.
End Squares.

(* ---------------------------------------------------------------- statements *)

(* Coefficients and exponents of the variables 0, 1, ... *)
Definition polynomial := list (Q * list nat).
Definition at_point (x : nat -> R) (p : polynomial) : R :=
  fold_right (fun term total => Q2R (fst term) * monomial_value x 0 (snd term) + total) 0 p.

(* The common denominator, and the polynomial times a multiple of it. *)
Definition denominator (p : polynomial) : Z := fold_right (fun term d => Z.lcm (Zpos (Qden (fst term))) d) 1%Z p.
Definition whole (c : Z) (p : polynomial) : tree :=
  fold_right (fun term t => add (monomial (Qnum (fst term) * (c / Zpos (Qden (fst term)))) (snd term)) t) Zero p.

Lemma lcm_positive a b : (0 < a -> 0 < b -> 0 < Z.lcm a b)%Z.
Proof.
  intros pa pb. pose proof (Z.lcm_nonneg a b). enough (Z.lcm a b <> 0)%Z by lia. intro zero.
  apply Z.lcm_eq_0 in zero. lia.
Qed.

Lemma denominator_positive p : (0 < denominator p)%Z.
Proof. induction p as [| t p H]; [reflexivity |]. apply lcm_positive; [reflexivity | exact H]. Qed.

Lemma value_whole x c p : (denominator p | c)%Z -> value x 0 (whole c p) = IZR c * at_point x p.
Proof.
  induction p as [| [[n d] e] p H]; intro divides; [cbn; ring |].
  change (whole c ((Qmake n d, e) :: p)) with (add (monomial (n * (c / Zpos d)) e) (whole c p)).
  change (at_point x ((Qmake n d, e) :: p)) with (Q2R (Qmake n d) * monomial_value x 0 e + at_point x p).
  change (denominator ((Qmake n d, e) :: p)) with (Z.lcm (Zpos d) (denominator p)) in divides.
  rewrite value_add, value_monomial, H by (eapply Z.divide_trans; [apply Z.divide_lcm_r | exact divides]).
  assert (divisor : (Zpos d | c)%Z) by (eapply Z.divide_trans; [apply Z.divide_lcm_l | exact divides]).
  destruct divisor as [k ->]. rewrite Z.div_mul by lia.
  unfold Q2R; cbn [Qnum Qden]. rewrite !mult_IZR. field. apply IZR_neq; lia.
Qed.

Lemma whole_sign x c p : (0 < c)%Z -> (denominator p | c)%Z ->
  (0 <= at_point x p <-> 0 <= value x 0 (whole c p)) /\ (at_point x p = 0 -> value x 0 (whole c p) = 0).
Proof.
  intros pos divides. rewrite (value_whole x c p divides). apply IZR_lt in pos. repeat split; intros; nra.
Qed.

(* P >= 0 where the inequalities g >= 0 and the equalities h = 0 hold. *)
Record question : Set := Question { target : polynomial; inequalities : list polynomial; equalities : list polynomial }.

Definition within (x : nat -> R) (q : question) : Prop :=
  Forall (fun g => 0 <= at_point x g) (inequalities q) /\ Forall (fun h => at_point x h = 0) (equalities q).

(* left * multiplier * P = right * (sum of products of inequalities with squares + sum of cofactors * equalities), P and the
   constraints each times their common denominator, which is said so that no number of the statement is without effect. *)
Record witness : Set := Witness
  { clearing : positive; left : positive; right : positive; multiplier : tree; squares : list square; cofactors : list tree }.

Definition proves (gs hs : list tree) (p : tree) (w : witness) : bool :=
  forallb square_definite (squares w) &&
  is_zero (add (scale (Zpos (left w)) (mul (multiplier w) p))
               (scale (Zneg (right w)) (add (sum_of gs (squares w)) (combination (cofactors w) hs)))).

Theorem proves_sound gs hs p w x : proves gs hs p w = true ->
  Forall (fun g => 0 <= value x 0 g) gs -> Forall (fun h => value x 0 h = 0) hs ->
  0 < value x 0 (multiplier w) -> 0 <= value x 0 p.
Proof.
  unfold proves. intros good allg allh pos. apply andb_prop in good as [definite zero].
  apply (value_is_zero x _ 0) in zero. rewrite value_add, !value_scale, value_mul, value_add in zero.
  rewrite (value_combination x _ _ allh) in zero.
  pose proof (value_sum_of x gs (squares w) definite allg) as sum.
  assert (l : 0 < IZR (Zpos (left w))) by now apply IZR_lt.
  assert (r : 0 < IZR (Zpos (right w))) by now apply IZR_lt.
  assert (minus : IZR (Zneg (right w)) = - IZR (Zpos (right w))) by (rewrite <- opp_IZR; reflexivity).
  rewrite minus in zero. destruct (Rle_lt_dec 0 (value x 0 p)) as [| negative]; [assumption | exfalso].
  assert (0 < IZR (Zpos (left w)) * value x 0 (multiplier w)) by now apply Rmult_lt_0_compat.
  assert (0 <= IZR (Zpos (right w)) * value x 0 (sum_of gs (squares w))) by (apply Rmult_le_pos; lra).
  nra.
Qed.

Definition common (q : question) : Z :=
  fold_right (fun p d => Z.lcm (denominator p) d) 1%Z (target q :: inequalities q ++ equalities q).
Definition cleared_inequalities (q : question) : list tree := map (whole (common q)) (inequalities q).
Definition accepts (q : question) (w : witness) : bool :=
  (common q =? Zpos (clearing w))%Z &&
  proves (cleared_inequalities q) (map (whole (common q)) (equalities q)) (whole (common q) (target q)) w.

Lemma common_divides q p : In p (target q :: inequalities q ++ equalities q) -> (denominator p | common q)%Z.
Proof.
  unfold common. induction (target q :: inequalities q ++ equalities q) as [| r l H]; cbn; [easy |]. intros [-> | here].
  - apply Z.divide_lcm_l.
  - eapply Z.divide_trans; [exact (H here) | apply Z.divide_lcm_r].
Qed.

Lemma common_positive q : (0 < common q)%Z.
Proof.
  unfold common. induction (target q :: inequalities q ++ equalities q) as [| r l H]; cbn [fold_right]; [reflexivity |].
  apply lcm_positive; [apply denominator_positive | exact H].
Qed.

Lemma target_sign x q : 0 <= at_point x (target q) <-> 0 <= value x 0 (whole (common q) (target q)).
Proof. apply whole_sign; [apply common_positive | apply common_divides; now left]. Qed.

Lemma within_cleared x q : within x q ->
  Forall (fun g => 0 <= value x 0 g) (cleared_inequalities q) /\
  Forall (fun h => value x 0 h = 0) (map (whole (common q)) (equalities q)).
Proof.
  intros [gs hs]. split; apply Forall_map, Forall_forall; intros p here.
  - apply (whole_sign x (common q) p (common_positive q)).
    + apply common_divides. right. apply in_or_app. now left.
    + exact (proj1 (Forall_forall _ _) gs p here).
  - apply (whole_sign x (common q) p (common_positive q)).
    + apply common_divides. right. apply in_or_app. now right.
    + exact (proj1 (Forall_forall _ _) hs p here).
Qed.

Theorem accepts_sound q w x : accepts q w = true -> within x q -> 0 < value x 0 (multiplier w) -> 0 <= at_point x (target q).
Proof.
  intros good inside pos. apply andb_prop in good as [_ good]. apply within_cleared in inside as [gs hs].
  apply target_sign. now apply (proves_sound _ _ _ w x good).
Qed.

(* ---------------------------------------------------------------- data *)

Definition term (c : Q) (exponents : list nat) := (c, exponents).
Definition power := monomial 1.
Definition sum := fold_right add Zero.
