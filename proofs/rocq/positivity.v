(* Polynomials that are nowhere negative on a set, or negative at a point of it.

   An identity proves P >= 0 where its multiplier is positive. What follows says where that is, and why it is enough that the
   multiplier vanishes on a thin part of an orthant only. *)

(* ---------------------------------------------------------------- signs of multipliers *)

Fixpoint coefficients_nonnegative (t : tree) : bool :=
  match t with
  | Zero => true
  | Constant c => (0 <=? c)%Z
  | Horner i m => coefficients_nonnegative i && coefficients_nonnegative m
  end.
Fixpoint constant_of (t : tree) : Z :=
  match t with Zero => 0%Z | Constant c => c | Horner i m => constant_of i end.

(* No odd power of a variable but of those that are nowhere negative: a part without powers, then x^2 times such a part. *)
Fixpoint even_in (signed : nat -> bool) (k : nat) (t : tree) : bool :=
  match t with
  | Zero | Constant _ => true
  | Horner i m => even_in signed (S k) i &&
      (if signed k then even_in signed k m
       else match m with
            | Zero => true
            | Constant c => (c =? 0)%Z
            | Horner j n => is_zero j && even_in signed k n
            end)
  end.

Section Signs.
Variable x : nat -> R.

Lemma value_nonnegative signed : (forall k, signed k = true -> 0 <= x k) ->
  forall t k, even_in signed k t = true -> coefficients_nonnegative t = true ->
  IZR (constant_of t) <= value x k t /\ 0 <= value x k t.
Proof.
  intro cone. fix H 1. intros [| c | i m] k even good; cbn in *.
  - lra.
  - apply Z.leb_le in good. apply IZR_le in good. lra.
  - apply andb_prop in even as [ei em]. apply andb_prop in good as [gi gm].
    destruct (H i (S k) ei gi) as [ci vi]. enough (0 <= x k * value x k m) by lra.
    destruct (signed k) eqn:sk.
    + apply Rmult_le_pos; [now apply cone | now apply H].
    + destruct m as [| c | j n]; cbn in *.
      * lra.
      * apply Z.eqb_eq in em; subst. lra.
      * apply andb_prop in em as [zj en]. apply andb_prop in gm as [_ gn]. rewrite (value_is_zero x j _ zj).
        destruct (H n k en gn) as [_ vn]. pose proof (Rle_0_sqr (x k)) as sq; unfold Rsqr in sq.
        replace (x k * (0 + x k * value x k n)) with (x k * x k * value x k n) by ring. now apply Rmult_le_pos.
Qed.
End Signs.

(* ---------------------------------------------------------------- polynomials along a line *)

Fixpoint along (l : list R) (t : R) : R := match l with nil => 0 | c :: l => c + t * along l t end.
Definition is_polynomial (f : R -> R) := exists l, forall t, f t = along l t.

Lemma constant_is_polynomial c : is_polynomial (fun _ => c).
Proof. exists [c]. intro t; cbn; ring. Qed.

Lemma sum_is_polynomial f g : is_polynomial f -> is_polynomial g -> is_polynomial (fun t => f t + g t).
Proof.
  intros [a ea] [b eb]. enough (exists l, forall t, along l t = along a t + along b t) as [l el].
  { exists l. intro t. now rewrite ea, eb, el. }
  clear f g ea eb. revert b. induction a as [| c a H]; intro b.
  - exists b. intro; cbn; ring.
  - destruct b as [| d b]; [exists (c :: a); intro; cbn; ring |].
    destruct (H b) as [l el]. exists (c + d :: l). intro; cbn. rewrite el. ring.
Qed.

Lemma product_is_polynomial f g : is_polynomial f -> is_polynomial g -> is_polynomial (fun t => f t * g t).
Proof.
  intros [a ea] [b eb]. enough (is_polynomial (fun t => along a t * along b t)) as [l el].
  { exists l. intro t. now rewrite ea, eb, el. }
  clear f g ea eb. induction a as [| c a [l H]].
  - exists nil. intro; cbn; ring.
  - destruct (sum_is_polynomial (fun t => c * along b t) (along (0 :: l))) as [m em].
    + enough (exists n, forall t, along n t = c * along b t) as [n en] by (exists n; intro; now rewrite en).
      clear. induction b as [| d b [n en]]; [exists nil; intro; cbn; ring |].
      exists (c * d :: n). intro; cbn. rewrite en. ring.
    + now exists (0 :: l).
    + exists m. intro t. rewrite <- em. cbn. rewrite <- H. ring.
Qed.

Lemma divide_at a : forall l, exists q, length q = pred (length l) /\ forall t, along l t = along l a + (t - a) * along q t.
Proof.
  induction l as [| c l [q [len H]]].
  - exists nil. split; [reflexivity | intro; cbn; ring].
  - destruct l as [| d l]; [exists nil; split; [reflexivity | intro; cbn; ring] |].
    exists (along (d :: l) a :: q). split; [cbn in *; lia |].
    intro t. change (along (c :: d :: l) t) with (c + t * along (d :: l) t).
    change (along (c :: d :: l) a) with (c + a * along (d :: l) a). cbn [along] in *. rewrite (H t). ring.
Qed.

(* A polynomial that vanishes on an interval vanishes. *)
Lemma zero_on_interval : forall n l d, length l = n -> 0 < d -> (forall t, 0 < t < d -> along l t = 0) -> forall t, along l t = 0.
Proof.
  induction n as [| n H]; intros l d len pos zero t.
  - destruct l; [reflexivity | discriminate].
  - destruct (divide_at (d / 2) l) as [q [lq eq]]. rewrite eq, (zero (d / 2)) by lra.
    rewrite (H q (d / 2)); [ring | lia | lra |]. intros s hs.
    specialize (eq s). rewrite (zero s), (zero (d / 2)) in eq by lra. rewrite Rplus_0_l in eq. symmetry in eq.
    apply Rmult_integral in eq as [eq | eq]; lra.
Qed.

Lemma along_continuous l : continuity (along l).
Proof.
  induction l as [| c l H]; [apply continuity_const; now intros ? ? |].
  apply (continuity_plus (fct_cte c) (mult_fct id (along l))).
  - apply continuity_const; now intros ? ?.
  - apply continuity_mult; [apply derivable_continuous, derivable_id | exact H].
Qed.

Definition on_line (x y : nat -> R) (t : R) : nat -> R := fun k => x k + t * (y k - x k).

Lemma value_on_line x y s : forall k, is_polynomial (fun t => value (on_line x y t) k s).
Proof.
  induction s as [| c | i Hi m Hm]; intro k; cbn.
  - apply constant_is_polynomial.
  - apply constant_is_polynomial.
  - apply sum_is_polynomial; [apply Hi |]. apply product_is_polynomial; [| apply Hm].
    exists [x k; y k - x k]. intro; unfold on_line; cbn; ring.
Qed.

Lemma value_ends x y s : forall k, value (on_line x y 0) k s = value x k s /\ value (on_line x y 1) k s = value y k s.
Proof.
  induction s as [| c | i Hi m Hm]; intro k; cbn; [easy | easy |].
  destruct (Hi (S k)) as [-> ->]. destruct (Hm k) as [-> ->]. unfold on_line. split; ring.
Qed.

(* Where multiplier * P >= 0 and multiplier >= 0 on the segment from x to y, and the multiplier is not zero at y, P x >= 0. *)
Lemma dense multiplier p x y :
  (forall t, 0 <= t <= 1 -> 0 <= value (on_line x y t) 0 multiplier /\
                            (0 < value (on_line x y t) 0 multiplier -> 0 <= value (on_line x y t) 0 p)) ->
  value y 0 multiplier <> 0 -> 0 <= value x 0 p.
Proof.
  intros segment some. destruct (Rle_lt_dec 0 (value x 0 p)) as [| negative]; [assumption | exfalso; apply some].
  destruct (value_on_line x y multiplier 0) as [m em]. destruct (value_on_line x y p 0) as [f ef].
  rewrite <- (proj2 (value_ends x y multiplier 0)), em.
  assert (start : along f 0 = value x 0 p) by (rewrite <- ef; apply value_ends).
  destruct (along_continuous f 0 (- value x 0 p) ltac:(lra)) as [d [pos near]].
  apply (zero_on_interval (length m) m (Rmin d 1)); [reflexivity | apply Rmin_glb_lt; lra |].
  intros t [low high]. pose proof (Rmin_l d 1). pose proof (Rmin_r d 1).
  destruct (segment t ltac:(lra)) as [ge impl]. rewrite em, ef in *.
  destruct (Rle_lt_or_eq_dec _ _ ge) as [gt | eq]; [exfalso | now symmetry].
  specialize (impl gt). specialize (near t). cbn in near. unfold R_dist, D_x, no_cond in near. rewrite start in near.
  assert (Rabs (along f t - value x 0 p) < - value x 0 p).
  { apply near. repeat split; [lra |]. rewrite Rminus_0_r, Rabs_right; lra. }
  apply Rabs_def2 in H1. lra.
Qed.

(* ---------------------------------------------------------------- orthants *)

Fixpoint index_of_unit (e : list nat) : option nat :=
  match e with
  | 0%nat :: e => option_map S (index_of_unit e)
  | 1%nat :: e => if forallb (Nat.eqb 0) e then Some O else None
  | _ => None
  end.

(* The variable of which a constraint is a positive multiple. *)
Definition variable_of (g : polynomial) : option nat :=
  match g with [(c, e)] => if (0 <? Qnum c)%Z then index_of_unit e else None | _ => None end.
Definition signed (q : question) (k : nat) : bool :=
  existsb (fun g => match variable_of g with Some j => Nat.eqb j k | None => false end) (inequalities q).
Definition orthant (q : question) : bool :=
  match equalities q with
  | nil => forallb (fun g => match variable_of g with Some _ => true | None => false end) (inequalities q)
  | _ => false
  end.

Lemma monomial_of_zeros x : forall e k, forallb (Nat.eqb 0) e = true -> monomial_value x k e = 1.
Proof.
  induction e as [| n e H]; intros k zeros; cbn in *; [reflexivity |].
  apply andb_prop in zeros as [n0 rest]. destruct n; [| discriminate]. rewrite H by exact rest. cbn; ring.
Qed.

Lemma monomial_of_unit x : forall e j k, index_of_unit e = Some j -> monomial_value x k e = x (k + j)%nat.
Proof.
  induction e as [| n e H]; intros j k unit; cbn in unit; [discriminate |].
  destruct n as [| [| n]]; [| | discriminate].
  - destruct (index_of_unit e) as [i |]; [| discriminate]. injection unit as <-. cbn.
    rewrite (H i (S k) eq_refl). replace (k + S i)%nat with (S k + i)%nat by lia. ring.
  - destruct (forallb _ e) eqn:zeros; [| discriminate]. injection unit as <-. cbn.
    rewrite monomial_of_zeros by exact zeros. rewrite Nat.add_0_r. ring.
Qed.

Lemma value_of_variable g j : variable_of g = Some j -> exists c, 0 < c /\ forall x, at_point x g = c * x j.
Proof.
  destruct g as [| [c e] [|]]; cbn; try discriminate. destruct (0 <? Qnum c)%Z eqn:pos; [| discriminate].
  intro unit. exists (Q2R c). split.
  - apply Z.ltb_lt in pos. unfold Q2R. apply Rmult_lt_0_compat; [now apply IZR_lt | apply Rinv_0_lt_compat; now apply IZR_lt].
  - intro x. rewrite (monomial_of_unit x e j 0 unit). cbn. ring.
Qed.

Lemma signed_nonnegative q x k : within x q -> signed q k = true -> 0 <= x k.
Proof.
  intros [gs _] s. apply existsb_exists in s as [g [here eq]]. destruct (variable_of g) as [j |] eqn:v; [| discriminate].
  apply Nat.eqb_eq in eq; subst. destruct (value_of_variable _ _ v) as [c [pos val]].
  pose proof (proj1 (Forall_forall _ _) gs g here) as ge. cbn in ge. rewrite val in ge.
  apply Rmult_le_reg_l with c; lra.
Qed.

Lemma orthant_convex q x y t : orthant q = true -> within x q -> within y q -> 0 <= t <= 1 -> within (on_line x y t) q.
Proof.
  unfold orthant, within. destruct (equalities q); [| discriminate]. intros units [gx _] [gy _] range.
  split; [| constructor]. apply Forall_forall. intros g here.
  pose proof (proj1 (forallb_forall _ _) units g here) as v. cbn in v.
  destruct (variable_of g) as [j |] eqn:vg; [| discriminate]. destruct (value_of_variable _ _ vg) as [c [pos val]].
  pose proof (proj1 (Forall_forall _ _) gx g here) as px. pose proof (proj1 (Forall_forall _ _) gy g here) as py.
  cbn in px, py. rewrite val in *. unfold on_line. nra.
Qed.

(* ---------------------------------------------------------------- nowhere negative *)

(* Why a multiplier is nowhere negative on the set: by its terms, or as numerator * multiplier - rest = squares, rest >= 0. *)
Inductive reason : Set := Terms | Sums (numerator rest : positive) (w : witness) | Dense (w : witness).

Definition gap (r : reason) (m : tree) : Z := match r with Terms => constant_of m | Sums _ rest _ => Zpos rest | Dense _ => 0 end.
Definition sums (q : question) (t : tree) (w : witness) : bool :=
  proves (cleared_inequalities q) nil t w && is_zero (add_constant (-1) (multiplier w)) && (common q =? Zpos (clearing w))%Z.
Definition nowhere_negative (q : question) (m : tree) (r : reason) : bool :=
  match r with
  | Terms => even_in (signed q) 0 m && coefficients_nonnegative m
  | Sums n rest w => sums q (add_constant (Zneg rest) (scale (Zpos n) m)) w
  | Dense w => sums q m w
  end.

Fixpoint value_at_integers (y : nat -> Z) (k : nat) (t : tree) : Z :=
  match t with
  | Zero => 0
  | Constant c => c
  | Horner i m => value_at_integers y (S k) i + y k * value_at_integers y k m
  end.
(* The j-th powers of primes: of a polynomial other than zero, of n terms in as many variables, one of j = 0, ..., n - 1 is
   no zero, as these values of its monomials differ. *)
Definition elsewhere (j : nat) (k : nat) : Z :=
  (nth k [2; 3; 5; 7; 11; 13; 17; 19; 23; 29; 31; 37; 41; 43; 47; 53] 1 ^ Z.of_nat j)%Z.

(* P >= 0 on the set of a question: the multiplier is positive on it, or it is an orthant and the multiplier is not zero. *)
Definition nonnegative (q : question) (w : witness) (r : reason) : bool :=
  accepts q w && nowhere_negative q (multiplier w) r &&
  (if (0 <? gap r (multiplier w))%Z then true
   else orthant q && first (fun j => negb (value_at_integers (elsewhere j) 0 (multiplier w) =? 0)%Z) (seq 0 1000)).

Lemma value_integers y t : forall k, value (fun k => IZR (y k)) k t = IZR (value_at_integers y k t).
Proof. induction t as [| c | i Hi m Hm]; intro k; cbn; rewrite ?plus_IZR, ?mult_IZR, ?Hi, ?Hm; reflexivity. Qed.

Lemma one_value x m : is_zero (add_constant (-1) m) = true -> 0 < value x 0 m.
Proof. intro z. apply (value_is_zero x _ 0) in z. rewrite value_add_constant in z. lra. Qed.

Lemma sums_sound q t w x : sums q t w = true -> within x q -> 0 <= value x 0 t.
Proof.
  unfold sums. intros good inside. apply andb_prop in good as [good _]. apply andb_prop in good as [good one].
  destruct (within_cleared x q inside) as [gs _].
  exact (proves_sound _ _ _ w x good gs ltac:(constructor) (one_value x _ one)).
Qed.

Lemma nowhere_negative_sound q m r x : nowhere_negative q m r = true -> within x q ->
  0 <= value x 0 m /\ ((0 < gap r m)%Z -> 0 < value x 0 m).
Proof.
  intros good inside. destruct r as [| n rest w | w]; cbn [nowhere_negative gap] in *.
  - apply andb_prop in good as [one two].
    destruct (value_nonnegative x (signed q) (fun k => signed_nonnegative q x k inside) m 0 one two) as [c v].
    split; [exact v | intro pos; apply IZR_lt in pos; lra].
  - pose proof (sums_sound _ _ _ _ good inside) as ge. rewrite value_add_constant, value_scale in ge.
    assert (IZR (Zneg rest) < 0 < IZR (Zpos n)) as [a b] by (split; now apply IZR_lt).
    assert (0 < value x 0 m) by (apply Rmult_lt_reg_l with (IZR (Zpos n)); lra). split; [lra | easy].
  - split; [exact (sums_sound _ _ _ _ good inside) | intro pos; discriminate].
Qed.

Lemma elsewhere_positive j k : (0 < elsewhere j k)%Z.
Proof.
  apply Z.pow_pos_nonneg; [| apply Nat2Z.is_nonneg]. do 16 (destruct k as [| k]; [reflexivity |]). now destruct k.
Qed.

Lemma elsewhere_within q j : orthant q = true -> within (fun k => IZR (elsewhere j k)) q.
Proof.
  unfold orthant, within. destruct (equalities q); [| discriminate]. intro units. split; [| constructor].
  apply Forall_forall. intros g here. pose proof (proj1 (forallb_forall _ _) units g here) as v. cbn in v.
  destruct (variable_of g) as [i |] eqn:vg; [| discriminate]. destruct (value_of_variable _ _ vg) as [c [pos val]].
  rewrite val. pose proof (IZR_lt _ _ (elsewhere_positive j i)). apply Rmult_le_pos; lra.
Qed.

Theorem nonnegative_sound q w r : nonnegative q w r = true -> forall x, within x q -> 0 <= at_point x (target q).
Proof.
  unfold nonnegative. intros good x inside. apply andb_prop in good as [good where_]. apply andb_prop in good as [accept sign].
  destruct (nowhere_negative_sound q (multiplier w) r x sign inside) as [ge gt].
  destruct (0 <? gap r (multiplier w))%Z eqn:pos.
  - apply Z.ltb_lt in pos. exact (accepts_sound q w x accept inside (gt pos)).
  - apply andb_prop in where_ as [cone some]. apply first_some in some as [j some].
    apply target_sign. apply (dense (multiplier w) _ x (fun k => IZR (elsewhere j k))).
    + intros t range. pose proof (orthant_convex q x _ t cone inside (elsewhere_within q j cone) range) as it. split.
      * exact (proj1 (nowhere_negative_sound q _ r _ sign it)).
      * intro more. apply target_sign. exact (accepts_sound q w _ accept it more).
    + rewrite value_integers. apply IZR_neq. apply negb_true_iff, Z.eqb_neq in some. exact some.
Qed.

(* ---------------------------------------------------------------- negative at a point *)

Fixpoint rational_power (b : Q) (n : nat) : Q := match n with O => 1%Q | S n => Qred (b * rational_power b n) end.
Fixpoint rational_monomial (x : list Q) (e : list nat) : Q :=
  match e with
  | nil => 1%Q
  | n :: e => Qred (rational_power (hd 0%Q x) n * rational_monomial (tl x) e)
  end.
Definition rational_value (x : list Q) (p : polynomial) : Q :=
  fold_right (fun term total => Qred (fst term * rational_monomial x (snd term) + total)) 0%Q p.
Definition real_point (x : list Q) (k : nat) : R := Q2R (nth k x 0%Q).

Definition Q_dec_equal (a b : Q) : {a = b} + {a <> b}.
Proof. decide equality; [apply Pos.eq_dec | apply Z.eq_dec]. Defined.

(* The values are those of the polynomial and of the inequalities: said, so that no number is without effect. *)
Definition negative (q : question) (x values : list Q) : bool :=
  forallb (fun g => 0 <=? Qnum (rational_value x g))%Z (inequalities q) &&
  forallb (fun h => Qnum (rational_value x h) =? 0)%Z (equalities q) && (Qnum (rational_value x (target q)) <? 0)%Z &&
  (if list_eq_dec Q_dec_equal (map (rational_value x) (target q :: inequalities q)) values then true else false).

Lemma red_value a : Q2R (Qred a) = Q2R a.
Proof. apply Qeq_eqR, Qred_correct. Qed.

Lemma value_rational_power b n : Q2R (rational_power b n) = Q2R b ^ n.
Proof. induction n as [| n H]; cbn [rational_power pow]; [unfold Q2R; cbn; field | now rewrite red_value, Q2R_mult, H]. Qed.

Lemma value_rational_monomial : forall e x k y, (forall j, y (k + j)%nat = Q2R (nth j x 0%Q)) ->
  Q2R (rational_monomial x e) = monomial_value y k e.
Proof.
  induction e as [| n e H]; intros x k y same; cbn [rational_monomial monomial_value]; [unfold Q2R; cbn; field |].
  rewrite red_value, Q2R_mult, value_rational_power. rewrite (H (tl x) (S k) y).
  - specialize (same O). rewrite Nat.add_0_r in same. rewrite same. now destruct x.
  - intro j. replace (S k + j)%nat with (k + S j)%nat by lia. rewrite same. destruct x; [now destruct j | reflexivity].
Qed.

Lemma value_rational x p : Q2R (rational_value x p) = at_point (real_point x) p.
Proof.
  induction p as [| [c e] p H]; [unfold Q2R; cbn; field |]. cbn [rational_value fold_right at_point fst snd].
  rewrite red_value, Q2R_plus, Q2R_mult. rewrite (value_rational_monomial e x 0 (real_point x)) by reflexivity.
  unfold rational_value, at_point in H. now rewrite H.
Qed.

Lemma sign_of_rational a : ((0 <=? Qnum a)%Z = true -> 0 <= Q2R a) /\ ((Qnum a =? 0)%Z = true -> Q2R a = 0) /\
  ((Qnum a <? 0)%Z = true -> Q2R a < 0).
Proof.
  assert (pos : 0 < / IZR (Zpos (Qden a))) by (apply Rinv_0_lt_compat; now apply IZR_lt). unfold Q2R.
  repeat split; intro s.
  - apply Z.leb_le, IZR_le in s. apply Rmult_le_pos; lra.
  - apply Z.eqb_eq in s. rewrite s. ring.
  - apply Z.ltb_lt, IZR_lt in s. nra.
Qed.

Theorem negative_sound q x values : negative q x values = true -> within (real_point x) q /\ at_point (real_point x) (target q) < 0.
Proof.
  unfold negative. intro good. apply andb_prop in good as [good _]. apply andb_prop in good as [good neg]. apply andb_prop in good as [gs hs].
  repeat split.
  - apply Forall_forall. intros g here. rewrite <- value_rational. apply sign_of_rational.
    exact (proj1 (forallb_forall _ _) gs g here).
  - apply Forall_forall. intros h here. rewrite <- value_rational. apply sign_of_rational.
    exact (proj1 (forallb_forall _ _) hs h here).
  - rewrite <- value_rational. now apply sign_of_rational.
Qed.

(* ---------------------------------------------------------------- cells *)

(* P >= 0 where all variables are positive: there a multiplier with positive coefficients is positive. *)
Definition on_cell (q : question) (w : witness) : bool :=
  accepts q w && coefficients_nonnegative (multiplier w) &&
  (0 <? value_at_integers (fun _ => 1%Z) 0 (multiplier w))%Z.

Lemma positive_inside x : (forall k, 0 < x k) -> forall t k, coefficients_nonnegative t = true ->
  (0 <= value_at_integers (fun _ => 1%Z) k t)%Z /\ 0 <= value x k t /\
  ((0 < value_at_integers (fun _ => 1%Z) k t)%Z -> 0 < value x k t).
Proof.
  intro pos. induction t as [| c | i Hi m Hm]; intros k good; cbn [value value_at_integers coefficients_nonnegative] in *.
  - split; [lia | split; [lra | lia]].
  - apply Z.leb_le in good. split; [exact good | split; [now apply IZR_le | apply IZR_lt]].
  - apply andb_prop in good as [gi gm]. destruct (Hi (S k) gi) as (a & b & c), (Hm k gm) as (d & e & f).
    specialize (pos k). split; [lia | split; [nra |]]. intro some.
    destruct (Z.eq_dec (value_at_integers (fun _ => 1%Z) (S k) i) 0) as [z | nz].
    + specialize (f ltac:(lia)). nra.
    + specialize (c ltac:(lia)). nra.
Qed.

Theorem on_cell_sound q w : on_cell q w = true ->
  forall x, (forall k, 0 < x k) -> within x q -> 0 <= at_point x (target q).
Proof.
  unfold on_cell. intros good x pos inside. apply andb_prop in good as [good some]. apply andb_prop in good as [accept sign].
  apply (accepts_sound q w x accept inside). apply (positive_inside x pos _ 0 sign). now apply Z.ltb_lt.
Qed.
