(* The invariant polytope of a fault that slides or sticks, certificates of the kind stick_slip (proofs/FORMAT.md).

   [accepts] computes, with integers that enclose real numbers, what every facet is after a period of the sliding map and of the
   rest map, and bounds it on the polytope by multipliers that the file proposes. [polytope_sound] says once what its answer means:
   from rest, no sample leaves the polytope, for ever, where every period that begins inside of it is one of the two maps
   ([period]). The bounds of both maps are those of FORMAT.md ([sliding_bound], [resting_bound]); that they bound the motion of the
   fault is argued there. Ranges of slopes, damping and input gain are numbers of the file: two other checkers compute them. Enclosures of the
   impulse responses follow from their differential equation ([responses_near]). Standard library alone. *)

From Coq Require Import ZArith QArith Qreals Reals List Lra Lia Psatz.
Import ListNotations.
Local Open Scope R_scope.

(* ---------------------------------------------------------------- numbers: real ones, and what is known closely *)

Record numbers := Numbers {
  type : Type;
  number : Q -> type;
  plus : type -> type -> type;
  times : type -> type -> type;
  scaled : Z -> type -> type;
  size : type -> type;
  above : type -> type
}.

Definition reals : numbers := Numbers R Q2R Rplus Rmult (fun p x => IZR p * x) Rabs (Rmax 0).

(* A number within [radius] of [middle], in units of 2^-80. *)
Definition digits : Z := 80%Z.
Definition scale : Z := (2 ^ digits)%Z.
Record near := Near { middle : Z; radius : Z }.
Definition is_near (n : near) (x : R) : Prop := Rabs (x * IZR scale - IZR (middle n)) <= IZR (radius n).

Definition near_number (q : Q) : near :=
  let (d, m) := Z.div_eucl (Qnum q * scale) (Zpos (Qden q)) in Near d (if (m =? 0)%Z then 0 else 1).
Definition near_times (a b : near) : near :=
  let p := (middle a * middle b)%Z in
  let r := (Z.abs (middle a) * radius b + Z.abs (middle b) * radius a + radius a * radius b)%Z in
  if ((p =? 0) && (r =? 0))%Z then Near 0 0 else Near (Z.shiftr p digits) (Z.shiftr r digits + 2).
Definition closely : numbers := Numbers near near_number
  (fun a b => Near (middle a + middle b) (radius a + radius b)) near_times
  (fun p a => Near (p * middle a) (Z.abs p * radius a))
  (fun a => Near (Z.abs (middle a)) (radius a)) (fun a => if (middle a + radius a <=? 0)%Z then Near 0 0 else Near (Z.max 0 (middle a)) (radius a)).

Lemma scale_positive : 0 < IZR scale.
Proof. apply IZR_lt. reflexivity. Qed.

Lemma scale_positive_Z : (0 < scale)%Z.
Proof. reflexivity. Qed.
Opaque scale.

Lemma floor_near a b : (0 < b)%Z -> IZR (a / b) * IZR b <= IZR a < IZR (a / b) * IZR b + IZR b.
Proof.
  intro pb. pose proof (Z.div_mod a b ltac:(lia)) as e. pose proof (Z.mod_pos_bound a b pb) as [lo hi].
  rewrite <- mult_IZR, <- plus_IZR. split; [apply IZR_le | apply IZR_lt]; nia.
Qed.

Lemma near_number_sound q : is_near (near_number q) (Q2R q).
Proof.
  unfold is_near, near_number. pose proof (Z_div_mod (Qnum q * scale) (Zpos (Qden q)) eq_refl) as e.
  destruct (Z.div_eucl (Qnum q * scale) (Z.pos (Qden q))) as [d m]. destruct e as [e [lo hi]]. cbn [middle radius].
  assert (pd : 0 < IZR (Zpos (Qden q))) by now apply IZR_lt.
  assert (x : Q2R q * IZR scale = IZR d + IZR m / IZR (Zpos (Qden q))).
  { unfold Q2R. apply Rmult_eq_reg_r with (IZR (Zpos (Qden q))); [| lra].
    replace (IZR (Qnum q) * / IZR (Zpos (Qden q)) * IZR scale * IZR (Zpos (Qden q))) with (IZR (Qnum q) * IZR scale) by (field; lra).
    rewrite <- mult_IZR, e, plus_IZR, mult_IZR. field. lra. }
  rewrite x. replace (IZR d + IZR m / IZR (Zpos (Qden q)) - IZR d) with (IZR m / IZR (Zpos (Qden q))) by ring.
  apply IZR_le in lo. apply IZR_lt in hi. assert (pi := Rinv_0_lt_compat _ pd).
  assert (0 <= IZR m / IZR (Zpos (Qden q))) by (unfold Rdiv; nra). rewrite Rabs_pos_eq by assumption.
  destruct (Z.eqb_spec m 0) as [-> | _].
  - unfold Rdiv. lra.
  - apply Rmult_le_reg_r with (IZR (Zpos (Qden q))); [exact pd |]. unfold Rdiv. rewrite Rmult_assoc, Rinv_l by lra. lra.
Qed.

Lemma near_plus_sound a b x y : is_near a x -> is_near b y -> is_near (plus closely a b) (x + y).
Proof.
  unfold is_near; cbn. rewrite !plus_IZR. intros ha hb.
  replace ((x + y) * IZR scale - (IZR (middle a) + IZR (middle b))) with
    ((x * IZR scale - IZR (middle a)) + (y * IZR scale - IZR (middle b))) by ring.
  eapply Rle_trans; [apply Rabs_triang | lra].
Qed.

Lemma near_times_sound a b x y : is_near a x -> is_near b y -> is_near (times closely a b) (x * y).
Proof.
  unfold is_near. cbn [times closely]. unfold near_times. intros ha hb. pose proof scale_positive as pu.
  set (p := (middle a * middle b)%Z).
  set (r := (Z.abs (middle a) * radius b + Z.abs (middle b) * radius a + radius a * radius b)%Z).
  assert (far : Rabs (x * y * IZR scale * IZR scale - IZR p) <= IZR r).
  { unfold p, r. rewrite !plus_IZR, !mult_IZR, !abs_IZR.
    replace (x * y * IZR scale * IZR scale - IZR (middle a) * IZR (middle b)) with
      (IZR (middle a) * (y * IZR scale - IZR (middle b)) + IZR (middle b) * (x * IZR scale - IZR (middle a))
       + (x * IZR scale - IZR (middle a)) * (y * IZR scale - IZR (middle b))) by ring.
    eapply Rle_trans; [apply Rabs_triang |]. apply Rplus_le_compat.
    - eapply Rle_trans; [apply Rabs_triang |]. rewrite !Rabs_mult.
      apply Rplus_le_compat; apply Rmult_le_compat_l; auto using Rabs_pos.
    - rewrite Rabs_mult. apply Rmult_le_compat; auto using Rabs_pos. }
  destruct ((p =? 0) && (r =? 0))%Z eqn:none.
  - apply andb_prop in none as [zp zr]. apply Z.eqb_eq in zp, zr. rewrite zp, zr in far. cbn [middle radius].
    apply Rmult_le_reg_r with (IZR scale); [exact pu |]. rewrite <- (Rabs_pos_eq (IZR scale)) at 2 by lra.
    rewrite <- Rabs_mult, Rmult_0_l. replace ((x * y * IZR scale - 0) * IZR scale) with (x * y * IZR scale * IZR scale - 0) by ring. exact far.
  - cbn [middle radius]. rewrite !Z.shiftr_div_pow2 by discriminate. change (2 ^ digits)%Z with scale.
  destruct (floor_near p scale scale_positive_Z) as [pl ph]. destruct (floor_near r scale scale_positive_Z) as [rl rh].
    rewrite plus_IZR. apply Rabs_le.
    assert (t1 : x * y * IZR scale * IZR scale <= IZR p + IZR r).
    { pose proof (Rle_abs (x * y * IZR scale * IZR scale - IZR p)). lra. }
    assert (t2 : IZR p - IZR r <= x * y * IZR scale * IZR scale).
    { pose proof (Rle_abs (- (x * y * IZR scale * IZR scale - IZR p))) as h. rewrite Rabs_Ropp in h. lra. }
    split; apply Rmult_le_reg_r with (IZR scale); try exact pu; nra.
Qed.

Lemma near_scaled_sound p a x : is_near a x -> is_near (scaled closely p a) (IZR p * x).
Proof.
  unfold is_near; cbn. rewrite !mult_IZR, abs_IZR. intro h.
  replace (IZR p * x * IZR scale - IZR p * IZR (middle a)) with (IZR p * (x * IZR scale - IZR (middle a))) by ring.
  rewrite Rabs_mult. apply Rmult_le_compat_l; [apply Rabs_pos | exact h].
Qed.

Lemma near_size_sound a x : is_near a x -> is_near (size closely a) (Rabs x).
Proof.
  unfold is_near; cbn. rewrite abs_IZR. intro h. pose proof scale_positive as pu.
  rewrite <- (Rabs_pos_eq (IZR scale)) by lra. rewrite <- Rabs_mult.
  eapply Rle_trans; [apply Rabs_triang_inv2 | exact h].
Qed.

Lemma near_above_sound a x : is_near a x -> is_near (above closely a) (Rmax 0 x).
Proof.
  unfold is_near; cbn. intro h. pose proof scale_positive as pu.
  assert (h1 := Rle_trans _ _ _ (Rle_abs _) h). assert (h2 := h). rewrite <- Rabs_Ropp in h2.
  assert (h3 := Rle_trans _ _ _ (Rle_abs _) h2).
  destruct (Z.leb_spec (middle a + radius a) 0) as [z | _].
  - apply IZR_le in z. rewrite plus_IZR in z. assert (x * IZR scale <= 0) by lra. assert (x <= 0) by nra.
    rewrite Rmax_left by assumption. cbn. rewrite Rmult_0_l, Rminus_0_r, Rabs_R0. lra.
  - assert (m : IZR (Z.max 0 (middle a)) = Rmax 0 (IZR (middle a))).
    { destruct (Z.le_ge_cases 0 (middle a)) as [z | z]; pose proof (IZR_le _ _ z).
      - now rewrite Z.max_r, Rmax_right.
      - now rewrite Z.max_l, Rmax_left. }
    cbn [middle radius]. rewrite m. unfold Rmax. apply Rabs_le. repeat destruct Rle_dec; split; nra.
Qed.

(* ---------------------------------------------------------------- the loop in one period *)

(* What multiplies the slip error e1, the slip rate y, the level d and the slip until a stop. *)
Record vector (A : Type) := Vector { of_error : A; of_rate : A; of_level : A; of_stop : A }.
Arguments Vector {A}. Arguments of_error {A}. Arguments of_rate {A}. Arguments of_level {A}. Arguments of_stop {A}.

Record loop := Loop {
  step : Q; force : Q; authority : Q; beta : Q; slope_low : Q; slope_high : Q; chord_low : Q; chord_high : Q;
  damping_low : Q; damping_high : Q; rate : Q; bend : Q; bent_slip : Q; bent_rate : Q;
  rate_gain : Q; target_gain : Q; return_rate : Q; level_gain : Q; slip_gain : Q; rest_slip : Q; slip_noise : Q
}.

Record facet := Facet { n1 : Q; n2 : Q; n3 : Q; free : Q; bare : bool; free_cut : Q; bare_cut : bool; kept : Q }.

(* Slip and slip rate a time after a unit impulse of the slip rate, T first, then 15/16 T and so on down to 0; integrals over T. *)
Record responses (A : Type) := Responses { nodes : list (A * A); held_slip : A; held_rate : A }.
Arguments Responses {A}. Arguments nodes {A}. Arguments held_slip {A}. Arguments held_rate {A}.

Local Open Scope Q_scope.

Definition positive_part (q : Q) : Q := if Qle_bool 0 q then q else 0.
Definition magnitude (q : Q) : Q := if Qle_bool 0 q then q else - q.
Definition half : Q := 1 # 2.

Section Period.
Variable L : loop.

Definition told : Q := 2 * return_rate L * slip_noise L.
Definition late : Q := bend L * step L * half + told. (* r' up to which the reference may stand still *)
Definition growth : Q := / (1 - slope_high L * step L * step L * half).
Definition per_slip : Q := (slope_high L - slope_low L) * half * growth.
Definition per_rate : Q := (damping_high L - damping_low L) * half.
Definition steepest : Q := slope_high L * growth.
Definition predicted (f : facet) : Q := n3 f * (level_gain L + slip_gain L * step L * half).
(* What the reference moves less than T r', in the facet. *)
Definition drift (f : facet) : Q :=
  if Qle_bool (n1 f) 0 then - n1 f * (bend L * step L * step L * half) else n1 f * (step L * late).

Definition slip_factor (f : facet) (cut : bool) (s b : Q) : Q :=
  let v := n1 f + n3 f * ((if cut then 0 else slip_gain L) - s / (authority L * b)) in
  if (if cut then bare_cut f else bare f) then positive_part v else v.
Definition rate_factor (f : facet) (cut : bool) : Q :=
  if cut then n2 f + free_cut f
  else (let v := n2 f + n3 f * level_gain L in if bare f then positive_part v else v) + free f.
Definition slips_at_all (f : facet) (cut : bool) (s : Q) : bool :=
  negb (Qeq_bool (slip_factor f cut s 1) 0 && Qeq_bool (slip_factor f cut s (beta L)) 0).
Definition gap : Q := (beta L - 1) * (beta L - 1) / (4 * authority L * beta L).

(* The rate of the reference at an end of its range: of_e1 * e1 + fixed; whether the target rate is positive there, and
   whether the reference may stand still. *)
Record fate := Fate { positive : bool; still : bool; of_e1 : Q; fixed : Q }.

Variable N : numbers.
Notation "a + b" := (plus N a b). Notation "a * b" := (times N a b).
Let num := number N.

Fixpoint chords (left right : Z -> Z) (i : Z) (values : list (type N)) : type N :=
  match values with
  | a :: ((b :: _) as rest) => scaled N (left i) a + scaled N (right i) b + chords left right (Z.succ i) rest
  | _ => num 0%Q
  end.

Definition piece : Q := (step L / 16)%Q.

(* Integrals of h(t) t^j over a period, j = 0 to 3, h the chords of what is at least |m1 X(T - t) + m2 Y(T - t)| at the nodes. *)
Definition integrals (r : responses (type N)) (m1 m2 : type N) : vector (type N) :=
  let raise := (size N m1 * num (bent_slip L) + size N m2 * num (bent_rate L)) * num (piece * piece / 8)%Q in
  let sizes := map (fun xy => size N (m1 * fst xy + m2 * snd xy) + raise) (nodes r) in
  Vector
    (num (piece / 60)%Q * chords (fun _ => 30)%Z (fun _ => 30)%Z 0%Z sizes)
    (num (piece * piece / 60)%Q * chords (fun i => 30 * i + 10)%Z (fun i => 30 * i + 20)%Z 0%Z sizes)
    (num (piece * piece * piece / 60)%Q
     * chords (fun i => 30 * i * i + 20 * i + 5)%Z (fun i => 30 * i * i + 40 * i + 15)%Z 0%Z sizes)
    (num (piece * piece * piece * piece / 60)%Q
     * chords (fun i => 30 * i * i * i + 30 * i * i + 15 * i + 3)%Z
              (fun i => 30 * i * i * i + 60 * i * i + 45 * i + 12)%Z 0%Z sizes).

(* What the ranges of slope and damping add to the factors of y and of the force. *)
Definition others (whole : vector (type N)) : type N * type N :=
  let (i0, i1, i2, i3) := whole in
  (num per_slip * i1 + num per_rate * (i0 + num steepest * i2),
   num half * (num per_slip * i2 + num (per_rate * steepest)%Q * i3) + num per_rate * i1).

Definition free_slip (r : responses (type N)) : type N := match nodes r with xy :: _ => fst xy | nil => num 0%Q end.
Definition free_rate (r : responses (type N)) : type N := match nodes r with xy :: _ => snd xy | nil => num 0%Q end.

(* What the chord of 1/beta costs, of y and of the force. *)
Definition gaps (r : responses (type N)) : type N * type N :=
  let (a, j) := others (integrals r (num 1%Q) (num 0%Q)) in
  ((free_slip r + a) * num gap, (held_slip r + j) * num gap).

(* Factors of U and of y, and a constant, of a facet after a period of the sliding map. *)
Record parts := Parts { of_push : type N; of_y : type N; alone : type N }.
Definition parts_of (r : responses (type N)) (g : type N * type N) (f : facet) (cut : bool) (s b : Q) : parts :=
  let m1 := num (slip_factor f cut s b) in
  let m2 := num (rate_factor f cut) in
  let whole := integrals r m1 m2 in
  let (a, j) := others whole in
  let bent := num (if slips_at_all f cut s then magnitude (n3 f * s) else 0)%Q in
  Parts
    (num (- (authority L * b))%Q * (m1 * held_slip r + m2 * held_rate r + j))
    (m1 * free_slip r + m2 * free_rate r + a + bent * fst g
     + num (if cut then 0 else - (n3 f * slip_gain L * step L * half))%Q)
    (num (force L) * (of_error whole + j + bent * snd g)).

(* A facet at the end of a period less itself at its beginning: factors and a constant, at an end of r'. *)
Definition sliding_row (f : facet) (p : parts) (e : fate) : vector (type N) * type N :=
  let sign : Q := if positive e then 1 else 0 in
  let F := of_push p in
  (Vector
     (num (- (n1 f * step L * of_e1 e) - predicted f * sign * (of_e1 e - return_rate L))%Q
      + F * num (target_gain L * (return_rate L - of_e1 e))%Q)
     (of_y p + F * num (rate_gain L) + num (- n2 f)%Q)
     F
     (num 0%Q),
   num (- (n1 f * step L * fixed e) - predicted f * sign * fixed e)%Q + F * num (- (target_gain L * fixed e))%Q + alone p
   + size N F * num (slip_gain L * slip_noise L)%Q
   + (if negb (Qle_bool (n1 f) 0) && still e
      then above N (F * num (- target_gain L)%Q + num (- (predicted f * sign))%Q) * num late else num (drift f))).

(* The same where it ends at rest; a share of the innovation's cut-off counts. *)
Definition resting_row (f : facet) (s share : Q) (e : fate) : vector (type N) * type N :=
  let sign : Q := if positive e then 1 else 0 in
  let part : Q := (n3 f * slip_gain L * share)%Q in
  (Vector
     (num (- (n1 f * step L * of_e1 e) - predicted f * sign * (of_e1 e - return_rate L))%Q)
     (num (- (part * step L * half) - n2 f)%Q)
     (num 0%Q)
     (num (n1 f - n3 f * (s / authority L) + part)%Q),
   num (- (n1 f * step L * fixed e) - predicted f * sign * fixed e
        + (if Qle_bool (n3 f) 0 then (part - n3 f * slip_gain L) * (rest_slip L + 2 * slip_noise L) else 0)
        + (if negb (Qle_bool (n1 f) 0) && still e then positive_part (- (predicted f * sign)) * late else drift f))%Q).
End Period.

(* ---------------------------------------------------------------- a linear function on a polytope, by multipliers *)

Section Estimate.
Variable N : numbers.
Notation "a + b" := (plus N a b). Notation "a * b" := (times N a b).

Definition added (u v : vector (type N)) : vector (type N) :=
  Vector (of_error u + of_error v) (of_rate u + of_rate v) (of_level u + of_level v) (of_stop u + of_stop v).
Definition multiple (p : Z) (u : vector (type N)) : vector (type N) :=
  Vector (scaled N p (of_error u)) (scaled N p (of_rate u)) (scaled N p (of_level u)) (scaled N p (of_stop u)).
Definition zero_row : vector (type N) := let o := number N 0 in Vector o o o o.

Definition grain : Z := (2 ^ 40)%Z.
(* A constraint by its number, and its multiplier in units of 2^-40. *)
Record share := Share { which : Z; amount : BinNums.positive }.
Record hint := Hint { from_itself : bool; spends : list share }.
(* At the least and at the largest r'; whether the target rate, which is never negative, is left out. *)
Record pair := Pair { without_rate : bool; at_least : hint; at_largest : hint }.

Fixpoint spent (table : list (vector (type N) * type N)) (shares : list share)
    (left : vector (type N)) (total : type N) : vector (type N) * type N :=
  match shares with
  | nil => (left, total)
  | Share i p :: rest =>
      let c := nth (Z.to_nat i) table (zero_row, number N 0) in
      spent table rest (added left (multiple (Zneg p) (fst c))) (total + scaled N (Zpos p) (snd c))
  end.

(* [grain] times an upper bound of facet + row + constant where the constraints of the table hold; e1 <= 0 where
   [negative], else e1 >= 0, and all are within their sizes. *)
Definition estimate (table : list (vector (type N) * type N)) (sizes : vector (type N)) (negative : bool)
    (own : vector (type N)) (what : vector (type N) * type N) (by_ : hint) : type N :=
  let (left, total) :=
    spent table (spends by_)
      (multiple grain (if from_itself by_ then fst what else added own (fst what)))
      (scaled N grain (if from_itself by_ then number N 1 + snd what else snd what)) in
  total
  + (above N (if negative then scaled N (-1) (of_error left) else of_error left) * of_error sizes
     + above N (of_rate left) * of_rate sizes + size N (of_level left) * of_level sizes
     + above N (of_stop left) * of_stop sizes).

Definition lifted (v : vector Q) : vector (type N) :=
  Vector (number N (of_error v)) (number N (of_rate v)) (number N (of_level v)) (number N (of_stop v)).
Definition lifted_table (t : list (vector Q * Q)) : list (vector (type N) * type N) :=
  map (fun c => (lifted (fst c), number N (snd c))) t.
End Estimate.
Local Close Scope Q_scope.

(* ---------------------------------------------------------------- what is computed closely is near what is true *)

Definition near_vector (a : vector near) (x : vector R) : Prop :=
  is_near (of_error a) (of_error x) /\ is_near (of_rate a) (of_rate x) /\ is_near (of_level a) (of_level x) /\
  is_near (of_stop a) (of_stop x).
Definition near_pair (a : near * near) (x : R * R) : Prop := is_near (fst a) (fst x) /\ is_near (snd a) (snd x).
Definition near_row (a : vector near * near) (x : vector R * R) : Prop := near_vector (fst a) (fst x) /\ is_near (snd a) (snd x).
Definition near_responses (a : responses near) (x : responses R) : Prop :=
  Forall2 near_pair (nodes a) (nodes x) /\ is_near (held_slip a) (held_slip x) /\ is_near (held_rate a) (held_rate x).
Definition near_parts (a : parts closely) (x : parts reals) : Prop :=
  is_near (of_push _ a) (of_push _ x) /\ is_near (of_y _ a) (of_y _ x) /\ is_near (alone _ a) (alone _ x).

Lemma number_near q : is_near (number closely q) (number reals q).
Proof. apply near_number_sound. Qed.
Lemma plus_near a b (x y : R) : is_near a x -> is_near b y -> is_near (plus closely a b) (plus reals x y).
Proof. apply near_plus_sound. Qed.
Lemma times_near a b (x y : R) : is_near a x -> is_near b y -> is_near (times closely a b) (times reals x y).
Proof. apply near_times_sound. Qed.
Lemma scaled_near p a (x : R) : is_near a x -> is_near (scaled closely p a) (scaled reals p x).
Proof. apply near_scaled_sound. Qed.
Lemma size_near a (x : R) : is_near a x -> is_near (size closely a) (size reals x).
Proof. apply near_size_sound. Qed.
Lemma above_near a (x : R) : is_near a x -> is_near (above closely a) (above reals x).
Proof. apply near_above_sound. Qed.

Create HintDb near.
#[local] Hint Resolve number_near plus_near times_near scaled_near size_near above_near : near.
Ltac near := repeat split; cbn [fst snd of_error of_rate of_level of_stop of_push of_y alone] in *; auto 20 with near.

Lemma chords_near left right a x : Forall2 is_near a x -> forall i, is_near (chords closely left right i a) (chords reals left right i x).
Proof.
  induction 1 as [| u v a x h rest ih]; intro i; cbn [chords]; [near |].
  destruct rest as [| u' v' a x h' rest]; [near |]. specialize (ih (Z.succ i)). near.
Qed.

Lemma mapped {A B C D : Type} (P : A -> B -> Prop) (Q : C -> D -> Prop) f g a b :
  (forall u v, P u v -> Q (f u) (g v)) -> Forall2 P a b -> Forall2 Q (map f a) (map g b).
Proof. intro h. induction 1; cbn [map]; constructor; auto. Qed.

Lemma first_near a x : Forall2 near_pair a x ->
  is_near (match a with u :: _ => fst u | nil => number closely 0 end) (match x with u :: _ => fst u | nil => number reals 0 end) /\
  is_near (match a with u :: _ => snd u | nil => number closely 0 end) (match x with u :: _ => snd u | nil => number reals 0 end).
Proof. intros [| u v b y [h k] _]; near. Qed.

Section Near.
Variable L : loop.
Variables (r : responses near) (x : responses R).
Hypothesis known : near_responses r x.

Lemma integrals_near m1 m2 (y1 y2 : R) : is_near m1 y1 -> is_near m2 y2 ->
  near_vector (integrals L closely r m1 m2) (integrals L reals x y1 y2).
Proof.
  intros h1 h2. unfold integrals.
  cbv zeta.
  match goal with |- near_vector (Vector (times closely _ (chords closely _ _ _ ?a)) _ _ _) (Vector (times reals _ (chords reals _ _ _ ?b)) _ _ _) =>
    assert (all : Forall2 is_near a b) end.
  { destruct known as [h _]. refine (mapped _ _ _ _ _ _ _ h). intros u v [hu hv]. near. }
  near; apply times_near, chords_near; near.
Qed.

Lemma others_near a (y : vector R) : near_vector a y -> near_pair (others L closely a) (others L reals y).
Proof. destruct a, y. intros (h0 & h1 & h2 & h3). unfold others. near. Qed.

Lemma free_slip_near : is_near (free_slip closely r) (free_slip reals x).
Proof. unfold free_slip. destruct known as [h _]. exact (proj1 (first_near _ _ h)). Qed.
Lemma free_rate_near : is_near (free_rate closely r) (free_rate reals x).
Proof. unfold free_rate. destruct known as [h _]. exact (proj2 (first_near _ _ h)). Qed.
Lemma held_slip_near : is_near (held_slip r) (held_slip x).
Proof. apply known. Qed.
Lemma held_rate_near : is_near (held_rate r) (held_rate x).
Proof. apply known. Qed.
#[local] Hint Resolve free_slip_near free_rate_near held_slip_near held_rate_near : near.

Lemma gaps_near : near_pair (gaps L closely r) (gaps L reals x).
Proof.
  unfold gaps. assert (h := others_near _ _ (integrals_near _ _ _ _ (number_near 1) (number_near 0))).
  destruct (others L closely _), (others L reals _), h. near.
Qed.

Lemma parts_near f cut s b : near_parts (parts_of L closely r (gaps L closely r) f cut s b) (parts_of L reals x (gaps L reals x) f cut s b).
Proof.
  unfold parts_of. cbv zeta. destruct gaps_near as [g1 g2].
  assert (h := integrals_near _ _ _ _ (number_near (slip_factor L f cut s b)) (number_near (rate_factor L f cut))).
  assert (o := others_near _ _ h). destruct (others L closely _), (others L reals _), o, h. near.
Qed.

Lemma sliding_row_near f e p (y : parts reals) : near_parts p y -> near_row (sliding_row L closely f p e) (sliding_row L reals f y e).
Proof.
  intros (h1 & h2 & h3). unfold sliding_row. cbv zeta. near.
  apply plus_near; [near |]. destruct (negb _ && _); near.
Qed.

Lemma resting_row_near f s share e : near_row (resting_row L closely f s share e) (resting_row L reals f s share e).
Proof. unfold resting_row. cbv zeta. near. Qed.
End Near.

Lemma added_near a b x y : near_vector a x -> near_vector b y -> near_vector (added closely a b) (added reals x y).
Proof. intros (h0 & h1 & h2 & h3) (k0 & k1 & k2 & k3). unfold added. near. Qed.
Lemma multiple_near p a x : near_vector a x -> near_vector (multiple closely p a) (multiple reals p x).
Proof. intros (h0 & h1 & h2 & h3). unfold multiple. near. Qed.
Lemma lifted_near v : near_vector (lifted closely v) (lifted reals v).
Proof. unfold lifted. near. Qed.

Lemma spent_near table xs : Forall2 near_row table xs -> forall shares a b x y, near_vector a x -> is_near b y ->
  near_row (spent closely table shares a b) (spent reals xs shares x y).
Proof.
  intros all shares. induction shares as [| [i p] shares ih]; intros a b x y ha hb; [now split |].
  cbn [spent].
  assert (h : near_row (nth (Z.to_nat i) table (zero_row closely, number closely 0)) (nth (Z.to_nat i) xs (zero_row reals, number reals 0))).
  { generalize (Z.to_nat i) as k. clear ih. induction all as [| u v t xs h all ih']; intros [| k]; cbn [nth]; [| | exact h | apply ih'];
      unfold zero_row; near. }
  cbv zeta. destruct h as [h1 h2].
  apply ih; [apply added_near; [exact ha | apply multiple_near; exact h1] | apply plus_near; [exact hb | apply scaled_near; exact h2]].
Qed.

Lemma estimate_near table xs sizes ss negative own os what ws by_ :
  Forall2 near_row table xs -> near_vector sizes ss -> near_vector own os -> near_row what ws ->
  is_near (estimate closely table sizes negative own what by_) (estimate reals xs ss negative os ws by_).
Proof.
  intros all (s0 & s1 & s2 & s3) ho (hw & hk). unfold estimate.
  match goal with |- context [spent closely table (spends by_) ?a ?b] => match goal with |- context [spent reals xs (spends by_) ?x ?y] =>
    assert (h : near_row (spent closely table (spends by_) a b) (spent reals xs (spends by_) x y)) end end.
  { apply spent_near; [exact all | apply multiple_near; destruct (from_itself by_); auto using added_near |].
    destruct (from_itself by_); near. }
  destruct (spent closely _ _ _ _), (spent reals _ _ _ _), h as [(l0 & l1 & l2 & l3) ht].
  cbn [fst snd] in *. destruct negative; near.
Qed.

(* ---------------------------------------------------------------- multipliers bound a function on a polytope *)

Definition dot (a z : vector R) : R :=
  of_error a * of_error z + of_rate a * of_rate z + of_level a * of_level z + of_stop a * of_stop z.
Definition holds (z : vector R) (c : vector R * R) : Prop := dot (fst c) z <= snd c.

Lemma spent_bound z xs : Forall (holds z) xs -> forall shares x y,
  dot x z + y <= dot (fst (spent reals xs shares x y)) z + snd (spent reals xs shares x y).
Proof.
  intros all shares. induction shares as [| [i p] shares ih]; intros x y; cbn [spent]; [cbn; lra |].
  assert (h : holds z (nth (Z.to_nat i) xs (zero_row reals, number reals 0))).
  { generalize (Z.to_nat i) as k. clear ih. induction all as [| v xs h all ih']; intros [| k]; cbn [nth]; [| | exact h | apply ih'];
      unfold holds, dot, zero_row; cbn; replace (Q2R 0) with 0 by (unfold Q2R; cbn; lra); lra. }
  cbv zeta. eapply Rle_trans; [| apply ih]. unfold holds in h.
  assert (pp : 0 < IZR (Zpos p)) by now apply IZR_lt. apply (Rmult_le_compat_l _ _ _ (Rlt_le _ _ pp)) in h. clear pp.
  unfold dot, added, multiple, zero_row in *. cbn [plus scaled number type reals of_error of_rate of_level of_stop] in *.
  change (Zneg p) with (- Zpos p)%Z. rewrite opp_IZR.
  generalize dependent (IZR (Zpos p)). intro P. generalize dependent (nth (Z.to_nat i) xs (Vector (Q2R 0) (Q2R 0) (Q2R 0) (Q2R 0), Q2R 0)).
  intros. lra.
Qed.

(* Within the sizes, with the sign of e1 that is known. *)
Definition within (z sizes : vector R) (negative : bool) : Prop :=
  (if negative then - of_error sizes <= of_error z <= 0 else 0 <= of_error z <= of_error sizes) /\
  0 <= of_rate z <= of_rate sizes /\ Rabs (of_level z) <= of_level sizes /\ 0 <= of_stop z <= of_stop sizes.

Lemma above_times c u s : 0 <= u <= s -> c * u <= Rmax 0 c * s.
Proof. intros [h0 h1]. unfold Rmax. destruct Rle_dec; nra. Qed.

Lemma estimate_bound z xs sizes negative own what by_ :
  Forall (holds z) xs -> within z sizes negative -> dot own z <= 1 ->
  IZR grain * (dot own z + dot (fst what) z + snd what) <= estimate reals xs sizes negative own what by_.
Proof.
  intros all (w0 & w1 & w2 & w3) ho. destruct what as [c k]. cbn [fst snd]. unfold estimate.
  match goal with |- context [spent reals xs (spends by_) ?x ?y] =>
    assert (h := spent_bound z xs all (spends by_) x y);
    assert (start : IZR grain * (dot own z + dot c z + k) <= dot x z + y) end.
  { assert (pg : 0 < IZR grain) by now apply IZR_lt. apply (Rmult_le_compat_l _ _ _ (Rlt_le _ _ pg)) in ho. clear - ho.
    unfold multiple, added, dot in *.
    destruct (from_itself by_); cbn [plus scaled number type reals of_error of_rate of_level of_stop fst snd] in *;
      generalize dependent (IZR grain); intros G ho; [| lra].
    replace (Q2R 1) with 1 by (unfold Q2R; cbn; field). lra. }
  destruct (spent reals _ _ _ _) as [left total]. cbn [fst snd] in h.
  eapply Rle_trans; [exact start |]. eapply Rle_trans; [exact h |]. rewrite Rplus_comm. apply Rplus_le_compat_l.
  unfold dot. cbn [plus times above size scaled reals]. repeat apply Rplus_le_compat.
  - destruct negative; [| now apply above_times].
    apply Rle_trans with (-1 * of_error left * - of_error z); [apply Req_le; cbn; ring | apply above_times; destruct w0; split; change (type reals) with R; lra].
  - now apply above_times.
  - eapply Rle_trans; [apply Rle_abs |]. rewrite Rabs_mult. apply Rmult_le_compat_l; auto using Rabs_pos.
  - now apply above_times.
Qed.

(* ---------------------------------------------------------------- what a period may do, and what is computed of it *)

Record state := State { error : R; velocity : R; level : R }.
Definition with_stop (z : state) (stop : R) : vector R := Vector (error z) (velocity z) (level z) stop.
Definition reach (f : facet) (z : state) : R := Q2R (n1 f) * error z + Q2R (n2 f) * velocity z + Q2R (n3 f) * level z.
Definition inside (facets : list facet) (z : state) : Prop := 0 <= velocity z /\ Forall (fun f => reach f z <= 1) facets.

Section Claims.
Variable L : loop.
Variable facets : list facet.

(* How much less than the pressure of rest the held pressure is, where the law is told r' and measures [noise]. *)
Definition push (z : state) (r noise : R) : R :=
  Q2R (rate_gain L) * velocity z - Q2R (target_gain L) * (r - Q2R (return_rate L) * error z) + level z + noise.
Definition target_rate (z : state) (r : R) : R := Rmax 0 (r - Q2R (return_rate L) * error z).

Definition sliding_bound (x : responses R) (f : facet) (cut : bool) (s b : Q) (z : state) (r moved noise : R) : R :=
  let p := parts_of L reals x (gaps L reals x) f cut s b in
  Q2R (n1 f) * (error z - moved) + Q2R (n3 f) * level z - Q2R (predicted L f) * target_rate z r
  + of_push _ p * push z r noise + of_y _ p * velocity z + alone _ p.

Definition resting_bound (f : facet) (s share : Q) (z : state) (r moved stop : R) : R :=
  Q2R (n1 f) * (error z + stop - moved) + Q2R (n3 f) * (level z - Q2R (s / authority L) * stop)
  - Q2R (predicted L f) * target_rate z r
  + Q2R (n3 f * slip_gain L * share) * (stop - Q2R (step L * half) * velocity z)
  + (if Qle_bool (n3 f) 0 then Q2R ((n3 f * slip_gain L * share - n3 f * slip_gain L) * (rest_slip L + 2 * slip_noise L)) else 0).

(* Factors and constants of y that bound the slip until a last stop. *)
Definition stop_line (i : Z) : Q * Q :=
  let least := (half + damping_low L * step L / 24)%Q in
  let share := (least + (1 - least) * inject_Z i / 5)%Q in
  let m := (share * step L)%Q in
  let x := ((1 - share) * step L)%Q in
  let room := (1 + slope_low L * step L * step L * half
               - (damping_high L - damping_low L) * x / (1 - damping_low L * x * half))%Q in
  (Qred ((m - damping_low L * m * m * half + damping_low L * damping_low L * m * m * m / 6) / room),
   Qred (force L * x * x / (1 - damping_low L * x / 3) / room)).
Definition stop_lines : list (Q * Q) := map stop_line [0; 1; 2; 3; 4; 5]%Z.

Definition cuts (f : facet) : list bool := if Qle_bool (n3 f) 0 then [false] else [false; true].
Definition shares (f : facet) : list Q := if Qle_bool (n3 f) 0 then [kept f] else [0; 1]%Q.
Definition chord_ends : list Q := [chord_low L; chord_high L].
Definition betas : list Q := [1%Q; beta L].

(* The fault slides, or rests as it might slide: every facet is at most one of its bounds. *)
Definition slides (x : responses R) (z after : state) (r moved noise : R) : Prop :=
  Forall (fun f => exists cut s b, In cut (cuts f) /\ In s chord_ends /\ In b betas /\
    reach f after <= sliding_bound x f cut s b z r moved noise) facets.

(* It ends the period at rest, after a slip until its last stop. *)
Definition rests (z after : state) (r moved noise : R) : Prop :=
  exists stop, 0 <= stop /\ Forall (fun l => stop <= Q2R (fst l) * velocity z + Q2R (snd l)) stop_lines /\
    Q2R (force L) <= Q2R (authority L * beta L) * push z r noise - Q2R (slope_low L) * stop /\
    Forall (fun f => exists s share, In s chord_ends /\ In share (shares f) /\
      reach f after <= resting_bound f s share z r moved stop) facets.

Definition period (x : responses R) (z after : state) : Prop :=
  0 <= velocity after /\ exists r moved noise,
    0 <= r <= Q2R (rate L) /\ 0 <= moved /\
    Q2R (step L) * r - Q2R (step L * late L) <= moved <= Q2R (step L) * r + Q2R (bend L * step L * step L * half) /\
    Rabs noise <= Q2R (slip_gain L * slip_noise L) /\
    (slides x z after r moved noise \/ rests z after r moved noise).

(* At first the slip error is that of the noise, the fault rests. *)
Definition begun (z : state) : Prop :=
  error z = Q2R (slip_noise L) /\ velocity z = 0 /\ 0 <= level z <= Q2R (slip_gain L * slip_noise L).

(* Constraints: facets, y >= 0, the ends of a slice of e1; then of the slip until a stop. *)
Definition own_row (f : facet) : vector Q := Vector (n1 f) (n2 f) (n3 f) 0%Q.
Definition turn : Q := rate L / return_rate L.
Local Open Scope Q_scope.
Definition slice_ends (place : Z) : list (vector Q * Q) :=
  let up := Vector 1 0 0 0 in let down := Vector (-1#1) 0 0 0 in
  if (place =? 0)%Z then [(up, 0)] else if (place =? 1)%Z then [(down, 0); (up, turn)] else [(down, - turn)].
Definition slice_table (place : Z) : list (vector Q * Q) :=
  map (fun f => (own_row f, 1%Q)) facets ++ (Vector 0 (-1#1) 0 0, 0)%Q :: slice_ends place.
Definition rest_table (place : Z) (e : fate) : list (vector Q * Q) :=
  let most := (authority L * beta L)%Q in
  slice_table place ++ (Vector 0 0 0 (-1#1), 0)%Q ::
  (Vector (- (most * target_gain L * (return_rate L - of_e1 e))) (- (most * rate_gain L)) (- most) (slope_low L),
   most * (slip_gain L * slip_noise L - target_gain L * fixed e) - force L)%Q ::
  map (fun l => (Vector 0 (- fst l) 0 1, snd l)%Q) stop_lines.

(* The first five facets bound +e1, y, +d, -e1 and -d alone. *)
Definition lone (i : Z) (sign : Q) (f : facet) : bool :=
  let v := [n1 f; n2 f; n3 f] in
  let own := (sign * nth (Z.to_nat i) v 0)%Q in
  (negb (Qle_bool own 0)) && forallb (fun j => (j =? i)%Z || Qeq_bool (nth (Z.to_nat j) v 0) 0) [0; 1; 2]%Z.
Definition extent (i : nat) : Q :=
  match nth_error facets i with Some f => / (magnitude (n1 f) + magnitude (n2 f) + magnitude (n3 f)) | None => 0 end%Q.
Definition sizes (place : Z) : vector Q :=
  Vector (extent (if (place =? 0)%Z then 3 else 0)%nat) (extent 1%nat)
    (if Qle_bool (extent 2%nat) (extent 4%nat) then extent 4%nat else extent 2%nat)
    (let l := stop_line 5 in fst l * extent 1%nat + snd l).
Definition boxed : bool :=
  match facets with
  | a :: b :: c :: d :: e :: _ =>
      lone 0 1 a && lone 1 1 b && lone 2 1 c && lone 0 (-1#1) d && lone 2 (-1#1) e
  | _ => false
  end.

Local Close Scope Q_scope.

Definition to_the_rate (positive : bool) : fate := Fate positive false 0%Q (rate L).
Definition to_the_error (positive : bool) : fate := Fate positive false (return_rate L) 0%Q.
Definition standing (positive : bool) : fate := Fate positive true 0%Q 0%Q.
Definition sliding_ends : list (Z * fate) :=
  [(0, standing true); (0, to_the_rate true); (1, to_the_error true); (1, to_the_rate true);
   (1, standing false); (2, standing false); (2, to_the_rate false)]%Z.
(* Slice, and the least and largest r' of it. *)
Definition resting_ends : list (Z * fate * fate) :=
  [(0, standing true, to_the_rate true); (1, to_the_error true, to_the_rate true);
   (1, standing false, to_the_error false); (2, standing false, to_the_rate false)]%Z.

Fixpoint all2 {A B : Type} (good : A -> B -> bool) (a : list A) (b : list B) : bool :=
  match a, b with nil, nil => true | x :: a, y :: b => good x y && all2 good a b | _, _ => false end.

Definition sliding_cases (f : facet) : list (bool * Q * Q) := list_prod (list_prod (cuts f) chord_ends) betas.
Definition resting_cases (f : facet) : list (Q * Q) := list_prod chord_ends (shares f).

(* A polytope in numbers that are known closely. *)
Definition arena : Type := (list (vector near * near) * vector near * bool)%type.
Definition arena_of (place : Z) (table : list (vector Q * Q)) : arena :=
  (lifted_table closely table, lifted closely (sizes place), (place =? 0)%Z).
Definition at_most_one (a : arena) (own : vector near) (what : vector near * near) (h : hint) : bool :=
  let '(table, s, negative) := a in
  let v := estimate closely table s negative own what h in (middle v + radius v <=? grain * scale)%Z.

Definition slides_inside (places : list arena) (r : responses near) (g : near * near) (f : facet) (hints : list (list hint)) : bool :=
  let own := lifted closely (own_row f) in
  all2 (fun c hs => let '(cut, s, b) := c in
    let p := parts_of L closely r g f cut s b in
    all2 (fun ae h => at_most_one (fst ae) own (sliding_row L closely f p (snd (snd ae))) h) (combine places sliding_ends) hs)
    (sliding_cases f) hints.
Definition rests_inside (places : list arena) (f : facet) (hints : list (list pair)) : bool :=
  let own := lifted closely (own_row f) in
  all2 (fun c hs => let '(s, share) := c in
    all2 (fun ae h => let '(place, least, largest) := snd ae in
      let at_end e := if without_rate h then Fate false (still e) (of_e1 e) (fixed e) else e in
      (negb (without_rate h) || Qle_bool 0 (predicted L f))
      && at_most_one (fst ae) own (resting_row L closely f s share (at_end least)) (at_least h)
      && at_most_one (fst ae) own (resting_row L closely f s share (at_end largest)) (at_largest h))
      (combine places resting_ends) hs)
    (resting_cases f) hints.

Record proposals := Proposals {
  of_sliding : list (list (list hint)); of_resting : list (list (list pair));
  push_low : Q; push_high : Q; of_pushes : list pair
}.

(* U at r' = 0, and -U at the largest r'. *)
Definition push_row (low : bool) : vector Q :=
  let c := (target_gain L * return_rate L)%Q in
  (if low then Vector (- c) (- rate_gain L) (-1#1) 0 else Vector c (rate_gain L) 1 0)%Q.
Definition pushes_within (places : list arena) (p : proposals) : bool :=
  let noise := (slip_gain L * slip_noise L)%Q in
  all2 (fun a h =>
    at_most_one a (zero_row closely)
      (lifted closely (push_row true), number closely (1 + target_gain L * rate L + noise + push_low p)%Q) (at_least h)
    && at_most_one a (zero_row closely)
      (lifted closely (push_row false), number closely (1 + noise - push_high p)%Q) (at_largest h)) places (of_pushes p).

Definition signs : bool :=
  forallb (fun q => negb (Qle_bool q 0)) [step L; return_rate L; target_gain L; authority L; beta L]
  && forallb (Qle_bool 0) [rate L; bend L; slip_gain L; slip_noise L; late L; of_stop (sizes 0); fst (stop_line 5)].
Definition begins_inside : bool :=
  forallb (fun f => Qle_bool (n1 f * slip_noise L + positive_part (n3 f) * (slip_gain L * slip_noise L)) 1) facets.

End Claims.

Definition accepts (L : loop) (facets : list facet) (r : responses near) (p : proposals) : bool :=
  let flat := map (fun i => arena_of L facets i (slice_table L facets i)) [0; 1; 2]%Z in
  let seven := map (fun e => nth (Z.to_nat (fst e)) flat (nil, zero_row closely, false)) (sliding_ends L) in
  let four := map (fun e => let '(place, first, _) := e in arena_of L facets place (rest_table L facets place first)) (resting_ends L) in
  let g := gaps L closely r in
  signs L facets && boxed facets && begins_inside L facets && pushes_within L flat p
  && all2 (slides_inside L seven r g) facets (of_sliding p) && all2 (rests_inside L four) facets (of_resting p).

(* What is claimed: how far the slip is behind and ahead of the reference at most, the slip rate, the pressure; and the
   range of the pressure of rest. *)
Record claims := Claims {
  slip_behind : Q; slip_ahead : Q; peak_slip_rate : Q; least_pressure : Q; largest_pressure : Q; rest_low : Q; rest_high : Q
}.
Definition follows (L : loop) (facets : list facet) (p : proposals) (c : claims) : bool :=
  let moved := (step L * (rate L - told L))%Q in
  Qle_bool (extent facets 3 + slip_noise L + moved) (slip_behind c) && Qle_bool (extent facets 0 - slip_noise L + moved) (slip_ahead c)
  && Qle_bool (extent facets 1) (peak_slip_rate c)
  && Qle_bool (least_pressure c) (rest_low c - push_high p) && Qle_bool (rest_high c - push_low p) (largest_pressure c).

(* ---------------------------------------------------------------- what is computed keeps the state inside *)

Lemma Q2R_0 : Q2R 0 = 0.
Proof. unfold Q2R; cbn; lra. Qed.
Lemma Q2R_1 : Q2R 1 = 1.
Proof. unfold Q2R; cbn; field. Qed.
Lemma Q2R_m1 : Q2R (-1#1) = -1.
Proof. unfold Q2R; cbn; field. Qed.
Lemma below_true p q : Qle_bool p q = true -> Q2R p <= Q2R q.
Proof. intro h. now apply Qle_Rle, Qle_bool_iff. Qed.
Lemma below_false p q : Qle_bool p q = false -> Q2R q < Q2R p.
Proof. intro h. apply Qlt_Rlt, Qnot_le_lt. intro g. apply Qle_bool_iff in g. congruence. Qed.
Lemma positive_part_sound q : Q2R (positive_part q) = Rmax 0 (Q2R q).
Proof.
  unfold positive_part. destruct (Qle_bool 0 q) eqn:h.
  - apply below_true in h. rewrite Q2R_0 in h. now rewrite Rmax_right.
  - apply below_false in h. rewrite Q2R_0 in *. rewrite Rmax_left; lra.
Qed.
#[local] Hint Rewrite Q2R_minus Q2R_plus Q2R_mult Q2R_opp Q2R_0 Q2R_1 Q2R_m1 : reals.
Ltac push_down := autorewrite with reals in *.

Lemma all2_in {A B : Type} (good : A -> B -> bool) a b x : all2 good a b = true -> In x a -> exists y, good x y = true.
Proof.
  revert b. induction a as [| u a ih]; intros [| v b]; cbn; try easy. intros h [-> | i]; apply andb_prop in h as [g h].
  - now exists v.
  - now apply ih with b.
Qed.

Lemma at_most_one_sound L facets place table own what ws h : at_most_one (arena_of L facets place table) (lifted closely own) what h = true ->
  near_row what ws -> forall z,
  Forall (fun c => holds z (lifted reals (fst c), Q2R (snd c))) table ->
  within z (lifted reals (sizes L facets place)) (place =? 0)%Z ->
  dot (lifted reals own) z <= 1 -> dot (lifted reals own) z + dot (fst ws) z + snd ws <= 1.
Proof.
  intros ok near z all w ho. unfold at_most_one, arena_of in ok. apply Z.leb_le, IZR_le in ok. rewrite plus_IZR, mult_IZR in ok.
  assert (t : Forall2 near_row (lifted_table closely table) (lifted_table reals table)).
  { unfold lifted_table. clear. induction table; cbn [map]; constructor; [split; [apply lifted_near | apply number_near] | assumption]. }
  assert (e := estimate_near _ _ _ _ (place =? 0)%Z _ _ _ _ h t (lifted_near (sizes L facets place)) (lifted_near own) near).
  assert (xs : Forall (holds z) (lifted_table reals table)).
  { unfold lifted_table. clear - all. induction all; cbn [map]; constructor; assumption. }
  assert (b := estimate_bound z _ _ _ (lifted reals own) ws h xs w ho).
  unfold is_near in e. assert (e' := Rle_trans _ _ _ (Rle_abs _) e). clear e.
  set (est := estimate reals _ _ _ _ ws h) in *. clearbody est.
  assert (pu := scale_positive). assert (pg : 0 < IZR grain) by now apply IZR_lt.
  assert (est * IZR scale <= IZR grain * IZR scale) by lra.
  apply Rmult_le_reg_l with (IZR grain); [exact pg |]. rewrite Rmult_1_r.
  eapply Rle_trans; [exact b |]. apply Rmult_le_reg_r with (IZR scale); assumption.
Qed.

Lemma linear a b r k c : a <= r <= b -> k + c * a <= 1 -> k + c * b <= 1 -> k + c * r <= 1.
Proof. intros [l h] ha hb. destruct (Rle_or_lt 0 c); nra. Qed.

(* On what the reference does between two ends of its rate, the ends decide. *)
Lemma ends_decide n T lateness bent k slope a b r moved (stands : bool) :
  0 < T -> 0 <= lateness -> a <= r <= b -> 0 <= moved -> T * r - T * lateness <= moved <= T * r + bent ->
  k + slope * a - n * T * a
    + (if andb (if Rle_dec n 0 then false else true) stands then Rmax 0 slope * lateness
       else if Rle_dec n 0 then - n * bent else n * (T * lateness)) <= 1 ->
  (stands = true -> a = 0) ->
  k + slope * b - n * T * b + (if Rle_dec n 0 then - n * bent else n * (T * lateness)) <= 1 ->
  k + slope * r - n * moved <= 1.
Proof.
  intros pT pl [la lb] pm [ml mh] ha a0 hb. destruct (Rle_dec n 0) as [np | np]; cbn [andb] in ha.
  - assert (- n * moved <= - n * (T * r + bent)) by (apply Rmult_le_compat_l; lra).
    assert (g := linear a b r (k - n * bent) (slope - n * T) (conj la lb)). lra.
  - assert (n * (T * r - T * lateness) <= n * moved) by (apply Rmult_le_compat_l; lra).
    destruct stands.
    + specialize (a0 eq_refl). subst a.
      assert (top : slope * lateness <= Rmax 0 slope * lateness) by (apply Rmult_le_compat_r; [lra | apply Rmax_r]).
      destruct (Rle_or_lt r lateness) as [early | far].
      * assert (0 <= n * moved) by (apply Rmult_le_pos; lra).
        assert (slope * r <= Rmax 0 slope * lateness).
        { eapply Rle_trans; [apply Rmult_le_compat_r; [lra | apply Rmax_r] |]. apply Rmult_le_compat_l; [apply Rmax_l | exact early]. }
        lra.
      * assert (g := linear lateness b r (k + n * (T * lateness)) (slope - n * T)). lra.
    + assert (g := linear a b r (k + n * (T * lateness)) (slope - n * T) (conj la lb)). lra.
Qed.

Section Sound.
Variable L : loop.
Variable facets : list facet.
Hypothesis right_signs : signs L facets = true.
Hypothesis right_box : boxed facets = true.

Definition slice (place : Z) (z : state) : Prop :=
  if (place =? 0)%Z then error z <= 0 else if (place =? 1)%Z then 0 <= error z <= Q2R (turn L) else Q2R (turn L) <= error z.

Lemma sign_facts : 0 < Q2R (step L) /\ 0 < Q2R (return_rate L) /\ 0 < Q2R (target_gain L) /\ 0 < Q2R (authority L) /\
  0 < Q2R (beta L) /\ 0 <= Q2R (rate L) /\ 0 <= Q2R (bend L) /\ 0 <= Q2R (slip_gain L) /\ 0 <= Q2R (slip_noise L) /\
  0 <= Q2R (late L) /\ 0 <= Q2R (of_stop (sizes L facets 0)) /\ 0 <= Q2R (fst (stop_line L 5)).
Proof.
  assert (h := right_signs). unfold signs in h. cbn [forallb] in h.
  repeat match goal with h : (_ && _)%bool = true |- _ => apply andb_prop in h as [? ?] end.
  repeat match goal with h : negb _ = true |- _ => apply Bool.negb_true_iff, below_false in h; rewrite Q2R_0 in h end.
  repeat match goal with h : Qle_bool 0 _ = true |- _ => apply below_true in h; rewrite Q2R_0 in h end.
  repeat split; assumption.
Qed.

Lemma turn_rate : Q2R (return_rate L) * Q2R (turn L) = Q2R (rate L).
Proof.
  destruct sign_facts as (_ & h & _). unfold turn. rewrite Q2R_div.
  - field. lra.
  - intro e. apply Qeq_eqR in e. rewrite Q2R_0 in e. lra.
Qed.

Lemma dot_own f z stop : dot (lifted reals (own_row f)) (with_stop z stop) = reach f z.
Proof. unfold dot, reach, own_row, lifted, with_stop. cbn. rewrite Q2R_0. ring. Qed.

Lemma slice_table_holds place z stop : inside facets z -> slice place z ->
  Forall (fun c => holds (with_stop z stop) (lifted reals (fst c), Q2R (snd c))) (slice_table L facets place).
Proof.
  intros [y all] s. unfold slice_table. apply Forall_app. split.
  - clear - all. induction all as [| f l h all ih]; cbn [map]; constructor; [| exact ih].
    unfold holds. cbn [fst snd]. rewrite dot_own, Q2R_1. exact h.
  - assert (t := turn_rate). unfold slice in s. unfold slice_ends.
    apply Forall_cons; [| destruct (place =? 0)%Z; [| destruct (place =? 1)%Z]; repeat apply Forall_cons; try apply Forall_nil];
      unfold holds, dot, lifted, with_stop; cbn [fst snd of_error of_rate of_level of_stop number reals]; push_down; lra.
Qed.

Lemma rest_table_holds place e z stop : inside facets z -> slice place z -> 0 <= stop ->
  Forall (fun l => stop <= Q2R (fst l) * velocity z + Q2R (snd l)) (stop_lines L) ->
  Q2R (authority L * beta L) * (Q2R (target_gain L) * (Q2R (return_rate L) - Q2R (of_e1 e)) * - error z)
    - Q2R (authority L * beta L) * Q2R (rate_gain L) * velocity z - Q2R (authority L * beta L) * level z + Q2R (slope_low L) * stop
    <= Q2R (authority L * beta L) * (Q2R (slip_gain L) * Q2R (slip_noise L) - Q2R (target_gain L) * Q2R (fixed e)) - Q2R (force L) ->
  Forall (fun c => holds (with_stop z stop) (lifted reals (fst c), Q2R (snd c))) (rest_table L facets place e).
Proof.
  intros ins s ps lines cond. unfold rest_table. apply Forall_app. split; [now apply slice_table_holds |].
  constructor; [| constructor].
  - unfold holds, dot, lifted, with_stop; cbn [fst snd of_error of_rate of_level of_stop number reals]; push_down; lra.
  - unfold holds, dot, lifted, with_stop; cbn [fst snd of_error of_rate of_level of_stop number reals].
    revert cond. push_down. lra.
  - clear - lines. induction lines as [| l ls h lines ih]; cbn [map]; constructor; [| exact ih].
    unfold holds, dot, lifted, with_stop; cbn [fst snd of_error of_rate of_level of_stop number reals]. push_down. lra.
Qed.
End Sound.

Section Kept.
Variable L : loop.
Variable facets : list facet.
Hypothesis right_signs : signs L facets = true.
Hypothesis right_box : boxed facets = true.

(* What a facet is at the end of a period, as a function of r', without what the reference moves. *)
Definition sign_of (e : fate) : R := if positive e then 1 else 0.
Definition rate_of (e : fate) (z : state) : R := Q2R (of_e1 e) * error z + Q2R (fixed e).
Definition what_moves (f : facet) (slope : R) (stands : bool) : R :=
  if andb (if Rle_dec (Q2R (n1 f)) 0 then false else true) stands then Rmax 0 slope * Q2R (late L)
  else if Rle_dec (Q2R (n1 f)) 0 then - Q2R (n1 f) * Q2R (bend L * step L * step L * half)
  else Q2R (n1 f) * (Q2R (step L) * Q2R (late L)).

Lemma drift_sound f : Q2R (drift L f) =
  if Rle_dec (Q2R (n1 f)) 0 then - Q2R (n1 f) * Q2R (bend L * step L * step L * half)
  else Q2R (n1 f) * (Q2R (step L) * Q2R (late L)).
Proof.
  unfold drift. destruct (Qle_bool (n1 f) 0) eqn:h.
  - apply below_true in h. rewrite Q2R_0 in h. destruct Rle_dec; [| lra]. now rewrite Q2R_mult, Q2R_opp.
  - apply below_false in h. rewrite Q2R_0 in h. destruct Rle_dec; [lra |]. now rewrite !Q2R_mult.
Qed.

Lemma moves_up f : negb (Qle_bool (n1 f) 0) = (if Rle_dec (Q2R (n1 f)) 0 then false else true).
Proof.
  destruct (Qle_bool (n1 f) 0) eqn:h.
  - apply below_true in h. rewrite Q2R_0 in h. destruct Rle_dec; [reflexivity | lra].
  - apply below_false in h. rewrite Q2R_0 in h. destruct Rle_dec; [lra | reflexivity].
Qed.

Definition slide_level (f : facet) (p : parts reals) (sign : R) (z : state) : R :=
  Q2R (n1 f) * error z + Q2R (n3 f) * level z
  + of_push _ p * (Q2R (rate_gain L) * velocity z + Q2R (target_gain L) * Q2R (return_rate L) * error z + level z)
  + sign * Q2R (predicted L f) * Q2R (return_rate L) * error z + of_y _ p * velocity z + alone _ p
  + Rabs (of_push _ p) * Q2R (slip_gain L * slip_noise L).
Definition slide_slope (f : facet) (p : parts reals) (sign : R) : R :=
  - (of_push _ p * Q2R (target_gain L)) - sign * Q2R (predicted L f).

Lemma sliding_row_value f p e z :
  reach f z + dot (fst (sliding_row L reals f p e)) (with_stop z 0) + snd (sliding_row L reals f p e) =
  slide_level f p (sign_of e) z + slide_slope f p (sign_of e) * rate_of e z - Q2R (n1 f) * Q2R (step L) * rate_of e z
  + what_moves f (slide_slope f p (sign_of e)) (still e).
Proof.
  assert (tail : (if negb (Qle_bool (n1 f) 0) && still e
      then above reals (plus reals (times reals (of_push _ p) (number reals (- target_gain L)%Q))
        (number reals (- (predicted L f * (if positive e then 1 else 0)))%Q)) * Q2R (late L) else Q2R (drift L f))
      = what_moves f (slide_slope f p (sign_of e)) (still e)).
  { rewrite moves_up, drift_sound. unfold what_moves, slide_slope, sign_of. destruct (_ && _)%bool; [| reflexivity].
    cbn [above plus times number reals]. rewrite !Q2R_opp, Q2R_mult. f_equal. f_equal.
    destruct (positive e); rewrite ?Q2R_0, ?Q2R_1; ring. }
  unfold sliding_row. cbv zeta. cbn [fst snd].
  change (type reals) with R in *. set (t := if negb _ && _ then _ else _).
  assert (tt : t = what_moves f (slide_slope f p (sign_of e)) (still e)).
  { rewrite <- tail. unfold t. destruct (_ && _)%bool; reflexivity. }
  rewrite <- tt. clearbody t. clear tail tt.
  unfold slide_level, slide_slope, rate_of, reach, dot, with_stop, sign_of.
  cbn [of_error of_rate of_level of_stop above plus times size number reals]. push_down.
  destruct (positive e); push_down; ring.
Qed.

Definition rest_level (f : facet) (s share : Q) (sign : R) (z : state) (stop : R) : R :=
  Q2R (n1 f) * (error z + stop) + Q2R (n3 f) * (level z - Q2R (s / authority L) * stop)
  + sign * Q2R (predicted L f) * Q2R (return_rate L) * error z
  + Q2R (n3 f * slip_gain L * share) * (stop - Q2R (step L * half) * velocity z)
  + (if Qle_bool (n3 f) 0 then Q2R ((n3 f * slip_gain L * share - n3 f * slip_gain L) * (rest_slip L + 2 * slip_noise L)) else 0).

Lemma resting_row_value f s share e z stop :
  reach f z + dot (fst (resting_row L reals f s share e)) (with_stop z stop) + snd (resting_row L reals f s share e) =
  rest_level f s share (sign_of e) z stop + - (sign_of e * Q2R (predicted L f)) * rate_of e z
  - Q2R (n1 f) * Q2R (step L) * rate_of e z + what_moves f (- (sign_of e * Q2R (predicted L f))) (still e).
Proof.
  assert (tail : Q2R (if negb (Qle_bool (n1 f) 0) && still e then positive_part (- (predicted L f * (if positive e then 1 else 0))) * late L
      else drift L f) = what_moves f (- (sign_of e * Q2R (predicted L f))) (still e)).
  { unfold what_moves. rewrite <- moves_up, <- drift_sound. destruct (_ && _)%bool; [| reflexivity].
    rewrite Q2R_mult, positive_part_sound, Q2R_opp, Q2R_mult. unfold sign_of. f_equal. f_equal.
    destruct (positive e); rewrite ?Q2R_0, ?Q2R_1; ring. }
  unfold resting_row. cbv zeta. cbn [fst snd number reals]. rewrite !Q2R_plus, tail.
  generalize (what_moves f (- (sign_of e * Q2R (predicted L f))) (still e)). intro t. clear tail.
  unfold rest_level, rate_of, reach, dot, with_stop, sign_of.
  cbn [of_error of_rate of_level of_stop number reals]. generalize (s / authority L)%Q. intro sb.
  destruct (positive e), (Qle_bool (n3 f) 0); push_down; ring.
Qed.
End Kept.

Section Invariant.
Variable L : loop.
Variable facets : list facet.
Hypothesis right_signs : signs L facets = true.
Hypothesis right_box : boxed facets = true.
Variables (r : responses near) (x : responses R).
Hypothesis known : near_responses r x.

Lemma magnitude_sound q : Q2R (magnitude q) = Rabs (Q2R q).
Proof.
  unfold magnitude. destruct (Qle_bool 0 q) eqn:h.
  - apply below_true in h. rewrite Q2R_0 in h. now rewrite Rabs_pos_eq.
  - apply below_false in h. rewrite Q2R_0 in h. rewrite Q2R_opp, Rabs_left; lra.
Qed.

Lemma lone_bound (own a b sign : Q) c u v :
  Q2R sign = 1 \/ Q2R sign = -1 -> 0 < Q2R (sign * own) -> Q2R a = 0 -> Q2R b = 0 -> Q2R own * c + Q2R a * u + Q2R b * v <= 1 ->
  forall total, (total == magnitude own + magnitude a + magnitude b)%Q -> Q2R sign * c <= Q2R (/ total).
Proof.
  intros hs po za zb h total e. apply Qeq_eqR in e. rewrite !Q2R_plus, !magnitude_sound, za, zb, Rabs_R0 in e.
  rewrite Q2R_mult in po. rewrite za, zb in h.
  assert (m : Q2R total = Q2R sign * Q2R own).
  { rewrite e. destruct hs as [hs | hs]; rewrite hs in po |- *; [rewrite Rabs_pos_eq by lra | rewrite Rabs_left by lra]; lra. }
  rewrite Q2R_inv by (intro z; apply Qeq_eqR in z; rewrite Q2R_0 in z; lra). rewrite m.
  apply Rmult_le_reg_l with (Q2R sign * Q2R own); [exact po |]. rewrite Rinv_r by lra.
  destruct hs as [hs | hs]; rewrite hs in po |- *; lra.
Qed.

Lemma box z : inside facets z ->
  - Q2R (extent facets 3) <= error z <= Q2R (extent facets 0) /\ velocity z <= Q2R (extent facets 1) /\
  - Q2R (extent facets 4) <= level z <= Q2R (extent facets 2).
Proof.
  intros [_ all]. assert (h := right_box). unfold boxed in h.
  destruct facets as [| a [| b [| c [| d [| e l]]]]]; try discriminate. clear - h all.
  repeat match goal with h : (_ && _)%bool = true |- _ => apply andb_prop in h as [? ?] end.
  repeat match goal with all : Forall _ (_ :: _) |- _ => inversion all; clear all; subst end.
  unfold lone in *. cbn [nth Z.to_nat Pos.to_nat Pos.iter_op Init.Nat.add forallb Z.eqb orb Pos.eqb] in *.
  repeat match goal with h : (_ && _)%bool = true |- _ => apply andb_prop in h as [? ?] end.
  repeat match goal with h : negb _ = true |- _ => apply Bool.negb_true_iff, below_false in h; rewrite Q2R_0 in h end.
  repeat match goal with h : Qeq_bool _ 0 = true |- _ => apply Qeq_bool_iff, Qeq_eqR in h; rewrite Q2R_0 in h end.
  unfold extent. cbn [nth_error]. unfold reach in *.
  assert (A : Q2R 1 = 1 \/ Q2R 1 = -1) by (left; apply Q2R_1). assert (B : Q2R (-1#1) = 1 \/ Q2R (-1#1) = -1) by (right; apply Q2R_m1).
  repeat split.
  - assert (g := lone_bound (n1 d) (n2 d) (n3 d) (-1#1) (error z) (velocity z) (level z) B ltac:(assumption) ltac:(assumption) ltac:(assumption) ltac:(lra) _ (Qeq_refl _)).
    rewrite Q2R_m1 in g. lra.
  - assert (g := lone_bound (n1 a) (n2 a) (n3 a) 1 (error z) (velocity z) (level z) A ltac:(assumption) ltac:(assumption) ltac:(assumption) ltac:(lra) _ (Qeq_refl _)).
    rewrite Q2R_1 in g. lra.
  - assert (g := lone_bound (n2 b) (n1 b) (n3 b) 1 (velocity z) (error z) (level z) A ltac:(assumption) ltac:(assumption) ltac:(assumption) ltac:(lra)
      (magnitude (n1 b) + magnitude (n2 b) + magnitude (n3 b))%Q ltac:(ring)). rewrite Q2R_1 in g. lra.
  - assert (g := lone_bound (n3 e) (n1 e) (n2 e) (-1#1) (level z) (error z) (velocity z) B ltac:(assumption) ltac:(assumption) ltac:(assumption) ltac:(lra)
      (magnitude (n1 e) + magnitude (n2 e) + magnitude (n3 e))%Q ltac:(ring)). rewrite Q2R_m1 in g. lra.
  - assert (g := lone_bound (n3 c) (n1 c) (n2 c) 1 (level z) (error z) (velocity z) A ltac:(assumption) ltac:(assumption) ltac:(assumption) ltac:(lra)
      (magnitude (n1 c) + magnitude (n2 c) + magnitude (n3 c))%Q ltac:(ring)). rewrite Q2R_1 in g. lra.
Qed.

Lemma turn_positive : 0 <= Q2R (turn L).
Proof.
  destruct (sign_facts L facets right_signs) as (_ & h & _ & _ & _ & p & _). assert (t := turn_rate L facets right_signs).
  destruct (Rle_or_lt 0 (Q2R (turn L))) as [g | g]; [exact g |]. nra.
Qed.

Lemma within_slice place z stop : inside facets z -> slice L place z -> 0 <= stop <= Q2R (of_stop (sizes L facets 0)) ->
  within (with_stop z stop) (lifted reals (sizes L facets place)) (place =? 0)%Z.
Proof.
  intros ins sl [s0 s1]. destruct (box z ins) as (e & v & l0 & l1). destruct ins as [y _]. assert (t := turn_positive).
  unfold within, with_stop, lifted, sizes, slice in *. cbn [of_error of_rate of_level of_stop number reals] in *.
  repeat split; try assumption; try (destruct (place =? 0)%Z; [| destruct (place =? 1)%Z]; lra).
  unfold Rabs. destruct (Qle_bool (extent facets 2) (extent facets 4)) eqn:o;
    [apply below_true in o | apply below_false in o]; destruct Rcase_abs; lra.
Qed.

Definition flat : list arena := map (fun i => arena_of L facets i (slice_table L facets i)) [0; 1; 2]%Z.
Definition seven : list arena := map (fun e => nth (Z.to_nat (fst e)) flat (nil, zero_row closely, false)) (sliding_ends L).
Definition four : list arena :=
  map (fun e => let '(place, first, _) := e in arena_of L facets place (rest_table L facets place first)) (resting_ends L).

(* A period, less the maps. *)
Definition course (rate_ moved noise : R) : Prop :=
  0 <= rate_ <= Q2R (rate L) /\ 0 <= moved /\
  Q2R (step L) * rate_ - Q2R (step L * late L) <= moved <= Q2R (step L) * rate_ + Q2R (bend L * step L * step L * half) /\
  Rabs noise <= Q2R (slip_gain L * slip_noise L).

Lemma decided f k slope least largest z rate_ moved noise :
  course rate_ moved noise -> rate_of least z <= rate_ <= rate_of largest z -> (still least = true -> rate_of least z = 0) ->
  still largest = false ->
  k + slope * rate_of least z - Q2R (n1 f) * Q2R (step L) * rate_of least z + what_moves L f slope (still least) <= 1 ->
  k + slope * rate_of largest z - Q2R (n1 f) * Q2R (step L) * rate_of largest z + what_moves L f slope false <= 1 ->
  k + slope * rate_ - Q2R (n1 f) * moved <= 1.
Proof.
  intros (_ & pm & m & _) between zero _ h0 h1. rewrite Q2R_mult in m.
  destruct (sign_facts L facets right_signs) as (pT & _ & _ & _ & _ & _ & _ & _ & _ & pl & _).
  unfold what_moves in h1. rewrite Bool.andb_false_r in h1.
  eapply ends_decide; [exact pT | exact pl | exact between | exact pm | exact m | exact h0 | exact zero | exact h1].
Qed.

Lemma still_zero e z b : e = standing b \/ still e = false -> still e = true -> rate_of e z = 0.
Proof. intros [-> | h] s; [unfold rate_of, standing; cbn [of_e1 fixed]; rewrite Q2R_0; ring | congruence]. Qed.

Lemma slides_sound f hints cut s b z rate_ moved noise :
  slides_inside L seven r (gaps L closely r) f hints = true -> inside facets z -> reach f z <= 1 -> In cut (cuts f) -> In s (chord_ends L) ->
  In b (betas L) -> course rate_ moved noise -> sliding_bound L x f cut s b z rate_ moved noise <= 1.
Proof.
  intros ok ins hf ic is ib co. unfold slides_inside in ok.
  destruct (all2_in _ _ _ (cut, s, b) ok) as [hs all]. { unfold sliding_cases. repeat apply in_prod; assumption. }
  cbv beta iota in all. clear ok. set (p := parts_of L reals x (gaps L reals x) f cut s b).
  assert (one : forall place e, In (arena_of L facets place (slice_table L facets place), (place, e)) (combine seven (sliding_ends L)) ->
    slice L place z ->
    slide_level L f p (sign_of e) z + slide_slope L f p (sign_of e) * rate_of e z - Q2R (n1 f) * Q2R (step L) * rate_of e z
      + what_moves L f (slide_slope L f p (sign_of e)) (still e) <= 1).
  { intros place e i sl. destruct (all2_in _ _ _ _ all i) as [h ok]. cbn [fst snd] in ok.
    rewrite <- sliding_row_value. rewrite <- (dot_own f z 0).
    apply (at_most_one_sound _ _ _ _ _ _ _ _ ok).
    - apply sliding_row_near, parts_near, known.
    - now apply slice_table_holds.
    - apply within_slice; [exact ins | exact sl |].
    destruct (sign_facts L facets right_signs) as (_ & _ & _ & _ & _ & _ & _ & _ & _ & _ & g & _). lra.
    - now rewrite dot_own. }
  clear all. unfold seven, flat, sliding_ends in one. cbn [map nth combine fst Z.to_nat Pos.to_nat Pos.iter_op Init.Nat.add] in one.
  assert (t := turn_rate L facets right_signs). assert (tp := turn_positive).
  destruct (sign_facts L facets right_signs) as (_ & pc & _).
  set (v := rate_ - Q2R (return_rate L) * error z).
  assert (top : forall sign, Rmax 0 v = sign * v ->
    sliding_bound L x f cut s b z rate_ moved noise <= slide_level L f p sign z + slide_slope L f p sign * rate_ - Q2R (n1 f) * moved).
  { intros sign hv. unfold sliding_bound. cbv zeta. fold p. unfold target_rate. fold v. rewrite hv. unfold slide_level, slide_slope, push, v.
    destruct co as (_ & _ & _ & hn).
    assert (g : of_push _ p * noise <= Rabs (of_push _ p) * Q2R (slip_gain L * slip_noise L)).
    { eapply Rle_trans; [apply Rle_abs |]. rewrite Rabs_mult. apply Rmult_le_compat_l; [apply Rabs_pos | exact hn]. }
    change (type reals) with R in *. lra. }
  assert (co' := co). destruct co' as ([r0 r1] & _).
  assert (ends : forall sign least largest, Rmax 0 v = sign * v -> rate_of least z <= rate_ <= rate_of largest z ->
    (still least = true -> rate_of least z = 0) -> still largest = false ->
    slide_level L f p sign z + slide_slope L f p sign * rate_of least z - Q2R (n1 f) * Q2R (step L) * rate_of least z
      + what_moves L f (slide_slope L f p sign) (still least) <= 1 ->
    slide_level L f p sign z + slide_slope L f p sign * rate_of largest z - Q2R (n1 f) * Q2R (step L) * rate_of largest z
      + what_moves L f (slide_slope L f p sign) false <= 1 -> sliding_bound L x f cut s b z rate_ moved noise <= 1).
  { intros sign least largest hv between zero st h0 h1. eapply Rle_trans; [apply (top sign hv) |].
    exact (decided f _ _ least largest z rate_ moved noise co between zero st h0 h1). }
  assert (e0 : rate_of (standing true) z = 0) by (unfold rate_of, standing; cbn [of_e1 fixed]; rewrite Q2R_0; ring).
  assert (e0' : rate_of (standing false) z = 0) by exact e0.
  assert (e1 : forall q, rate_of (to_the_rate L q) z = Q2R (rate L)) by (intro; unfold rate_of, to_the_rate; cbn [of_e1 fixed]; rewrite Q2R_0; ring).
  assert (ec : forall q, rate_of (to_the_error L q) z = Q2R (return_rate L) * error z) by (intro; unfold rate_of, to_the_error; cbn [of_e1 fixed]; rewrite Q2R_0; ring).
  assert (up : 0 <= v -> Rmax 0 v = 1 * v) by (intro; rewrite Rmax_right; lra).
  assert (down : v <= 0 -> Rmax 0 v = 0 * v) by (intro; rewrite Rmax_left; lra).
  destruct (Rle_or_lt (error z) 0) as [low | high].
  - assert (sl : slice L 0 z) by exact low. assert (0 <= v) by (unfold v; nra).
    apply (ends 1 (standing true) (to_the_rate L true)); auto; [rewrite e0, e1; lra | |].
    + apply (one 0%Z (standing true)); [cbn; auto | exact sl].
    + apply (one 0%Z (to_the_rate L true)); [cbn; auto | exact sl].
  - destruct (Rle_or_lt (error z) (Q2R (turn L))) as [mid | far].
    + assert (sl : slice L 1 z) by (split; [lra | exact mid]).
      destruct (Rle_or_lt 0 v) as [pv | nv].
      * apply (ends 1 (to_the_error L true) (to_the_rate L true)); auto; [rewrite ec, e1; unfold v in pv; lra | discriminate | |].
        -- apply (one 1%Z (to_the_error L true)); [cbn; auto | exact sl].
        -- apply (one 1%Z (to_the_rate L true)); [cbn; auto | exact sl].
      * apply (ends 0 (standing false) (to_the_error L true)); [apply down; lra | rewrite e0', ec; unfold v in nv; lra | now intros | reflexivity | |].
        -- apply (one 1%Z (standing false)); [cbn; auto 10 | exact sl].
        -- assert (g := one 1%Z (to_the_error L true) ltac:(cbn; auto) sl). rewrite ec in *.
           unfold slide_level, slide_slope, sign_of, what_moves in *. cbn [positive to_the_error still] in *. rewrite !Bool.andb_false_r in *. lra.
    + assert (sl : slice L 2 z) by (unfold slice; cbn; lra).
      assert (v <= 0). { unfold v.
      assert (Q2R (return_rate L) * Q2R (turn L) <= Q2R (return_rate L) * error z) by (apply Rmult_le_compat_l; lra). lra. }
      apply (ends 0 (standing false) (to_the_rate L false)); auto; [rewrite e0', e1; lra | |].
      * apply (one 2%Z (standing false)); [cbn; auto 10 | exact sl].
      * apply (one 2%Z (to_the_rate L false)); [cbn; auto 10 | exact sl].
Qed.

Lemma rest_case f s share z rate_ moved noise stop least largest (h : pair) :
  course rate_ moved noise -> rate_of least z <= rate_ <= rate_of largest z -> (still least = true -> rate_of least z = 0) ->
  still largest = false -> Rmax 0 (rate_ - Q2R (return_rate L) * error z) = sign_of least * (rate_ - Q2R (return_rate L) * error z) ->
  sign_of largest = sign_of least -> (without_rate h = true -> Qle_bool 0 (predicted L f) = true) ->
  let at_end e := if without_rate h then Fate false (still e) (of_e1 e) (fixed e) else e in
  (forall e, e = least \/ e = largest ->
    rest_level L f s share (sign_of (at_end e)) z stop + - (sign_of (at_end e) * Q2R (predicted L f)) * rate_of (at_end e) z
    - Q2R (n1 f) * Q2R (step L) * rate_of (at_end e) z
    + what_moves L f (- (sign_of (at_end e) * Q2R (predicted L f))) (still (at_end e)) <= 1) ->
  resting_bound L f s share z rate_ moved stop <= 1.
Proof.
  intros co between zero st hv same drop at_end one.
  set (sign := if without_rate h then 0 else sign_of least).
  assert (top : resting_bound L f s share z rate_ moved stop <=
    rest_level L f s share sign z stop + - (sign * Q2R (predicted L f)) * rate_ - Q2R (n1 f) * moved).
  { unfold resting_bound, rest_level, target_rate, sign. rewrite hv.
    destruct (without_rate h); [| lra]. specialize (drop eq_refl). apply below_true in drop. rewrite Q2R_0 in drop.
    assert (0 <= Q2R (predicted L f) * Rmax 0 (rate_ - Q2R (return_rate L) * error z)) by (apply Rmult_le_pos; [exact drop | apply Rmax_l]).
    rewrite hv in H. lra. }
  eapply Rle_trans; [exact top |].
  assert (a := one least (or_introl eq_refl)). assert (b := one largest (or_intror eq_refl)). clear one top.
  assert (sl : sign_of (at_end least) = sign) by (unfold at_end, sign; destruct (without_rate h); reflexivity).
  assert (sb : sign_of (at_end largest) = sign) by (unfold at_end, sign; destruct (without_rate h); [reflexivity | exact same]).
  assert (ra : forall e, rate_of (at_end e) z = rate_of e z) by (intro; unfold at_end; destruct (without_rate h); reflexivity).
  assert (sa : forall e, still (at_end e) = still e) by (intro; unfold at_end; destruct (without_rate h); reflexivity).
  rewrite sl, ra, sa in a. rewrite sb, ra, sa, st in b.
  exact (decided f _ _ least largest z rate_ moved noise co between zero st a b).
Qed.

Lemma rests_sound f hints s share z rate_ moved noise stop :
  rests_inside L four f hints = true -> inside facets z -> reach f z <= 1 -> In s (chord_ends L) -> In share (shares f) ->
  course rate_ moved noise -> 0 <= stop ->
  Forall (fun l => stop <= Q2R (fst l) * velocity z + Q2R (snd l)) (stop_lines L) ->
  Q2R (force L) <= Q2R (authority L * beta L) * push L z rate_ noise - Q2R (slope_low L) * stop ->
  resting_bound L f s share z rate_ moved stop <= 1.
Proof.
  intros ok ins hf is ih co ps lines cond. unfold rests_inside in ok.
  destruct (all2_in _ _ _ (s, share) ok) as [hs all]. { unfold resting_cases. apply in_prod; assumption. }
  cbv beta iota in all. clear ok.
  destruct (sign_facts L facets right_signs) as (_ & pc & pt & pa & pb & pr & _ & pm & pn & _).
  assert (room : stop <= Q2R (of_stop (sizes L facets 0))).
  { unfold stop_lines in lines. cbn [map] in lines. repeat match goal with h : Forall _ (_ :: _) |- _ => inversion h; clear h; subst end.
    destruct (box z ins) as (_ & vy & _). destruct ins as [vp _].
    destruct (sign_facts L facets right_signs) as (_ & _ & _ & _ & _ & _ & _ & _ & _ & _ & _ & g).
    unfold sizes. cbn [of_stop]. rewrite Q2R_plus, Q2R_mult.
    assert (Q2R (fst (stop_line L 5)) * velocity z <= Q2R (fst (stop_line L 5)) * Q2R (extent facets 1)) by (apply Rmult_le_compat_l; assumption).
    lra. }
  assert (one : forall place least largest, In (place, least, largest) (resting_ends L) -> slice L place z ->
    rate_of least z <= rate_ -> exists h : pair,
    (without_rate h = true -> Qle_bool 0 (predicted L f) = true) /\
    forall e, e = least \/ e = largest ->
    let e' := if without_rate h then Fate false (still e) (of_e1 e) (fixed e) else e in
    rest_level L f s share (sign_of e') z stop + - (sign_of e' * Q2R (predicted L f)) * rate_of e' z
    - Q2R (n1 f) * Q2R (step L) * rate_of e' z + what_moves L f (- (sign_of e' * Q2R (predicted L f))) (still e') <= 1).
  { intros place least largest i sl above_.
    assert (i' : In (arena_of L facets place (rest_table L facets place least), (place, least, largest)) (combine four (resting_ends L))).
    { unfold four. revert i. generalize (resting_ends L). clear. induction l as [| [[p a] b] l ihl]; cbn; [easy |].
      intros [h | h]; [injection h as -> -> ->; now left | right; now apply ihl]. }
    destruct (all2_in _ _ _ _ all i') as [h ok]. cbn [fst snd] in ok. exists h.
    apply andb_prop in ok as [ok last]. apply andb_prop in ok as [drop first_].
    split. { intro w. rewrite w in drop. exact drop. }
    assert (table : Forall (fun c => holds (with_stop z stop) (lifted reals (fst c), Q2R (snd c))) (rest_table L facets place least)).
    { apply rest_table_holds; auto. unfold push in cond. rewrite Q2R_mult in *.
      destruct co as (_ & _ & _ & hn). rewrite Q2R_mult in hn. assert (hn' := Rle_trans _ _ _ (Rle_abs _) hn).
      unfold rate_of in above_. set (most := Q2R (authority L) * Q2R (beta L)) in *.
      assert (p : 0 < most) by (unfold most; apply Rmult_lt_0_compat; assumption).
      assert (most * noise <= most * (Q2R (slip_gain L) * Q2R (slip_noise L))) by (apply Rmult_le_compat_l; lra).
      assert (most * (Q2R (target_gain L) * (Q2R (of_e1 least) * error z + Q2R (fixed least))) <= most * (Q2R (target_gain L) * rate_))
        by (apply Rmult_le_compat_l; [lra | apply Rmult_le_compat_l; lra]). lra. }
    intros e he. cbv zeta. rewrite <- resting_row_value. rewrite <- (dot_own f z stop).
    assert (w : within (with_stop z stop) (lifted reals (sizes L facets place)) (place =? 0)%Z) by (apply within_slice; auto).
    destruct he as [-> | ->]; [apply (at_most_one_sound _ _ _ _ _ _ _ _ first_) | apply (at_most_one_sound _ _ _ _ _ _ _ _ last)];
      auto using resting_row_near; now rewrite dot_own. }
  clear all. assert (t := turn_rate L facets right_signs). assert (tp := turn_positive).
  set (v := rate_ - Q2R (return_rate L) * error z).
  assert (co' := co). destruct co' as ([r0 r1] & _).
  assert (e0 : forall q, rate_of (standing q) z = 0) by (intro; unfold rate_of, standing; cbn [of_e1 fixed]; rewrite Q2R_0; ring).
  assert (e1 : forall q, rate_of (to_the_rate L q) z = Q2R (rate L)) by (intro; unfold rate_of, to_the_rate; cbn [of_e1 fixed]; rewrite Q2R_0; ring).
  assert (ec : forall q, rate_of (to_the_error L q) z = Q2R (return_rate L) * error z) by (intro; unfold rate_of, to_the_error; cbn [of_e1 fixed]; rewrite Q2R_0; ring).
  assert (up : 0 <= v -> Rmax 0 v = 1 * v) by (intro; rewrite Rmax_right; lra).
  assert (down : v <= 0 -> Rmax 0 v = 0 * v) by (intro; rewrite Rmax_left; lra).
  assert (ends : forall place least largest, In (place, least, largest) (resting_ends L) -> slice L place z ->
    rate_of least z <= rate_ <= rate_of largest z -> (still least = true -> rate_of least z = 0) -> still largest = false ->
    Rmax 0 v = sign_of least * v -> sign_of largest = sign_of least -> resting_bound L f s share z rate_ moved stop <= 1).
  { intros place least largest i sl between zero st hv same. destruct (one place least largest i sl (proj1 between)) as (h & drop & both).
    exact (rest_case f s share z rate_ moved noise stop least largest h co between zero st hv same drop both). }
  destruct (Rle_or_lt (error z) 0) as [low | high].
  - assert (0 <= v) by (unfold v; nra).
    apply (ends 0%Z (standing true) (to_the_rate L true)); auto; [cbn; auto | rewrite e0, e1; lra].
  - destruct (Rle_or_lt (error z) (Q2R (turn L))) as [mid | far].
    + assert (sl : slice L 1 z) by (split; [lra | exact mid]).
      destruct (Rle_or_lt 0 v) as [pv | nv].
      * apply (ends 1%Z (to_the_error L true) (to_the_rate L true)); auto; [cbn; auto | rewrite ec, e1; unfold v in pv; lra | discriminate].
      * apply (ends 1%Z (standing false) (to_the_error L false)); auto; [cbn; auto | rewrite e0, ec; unfold v in nv; lra | apply down; lra].
    + assert (sl : slice L 2 z) by (unfold slice; cbn; lra).
      assert (v <= 0). { unfold v.
      assert (Q2R (return_rate L) * Q2R (turn L) <= Q2R (return_rate L) * error z) by (apply Rmult_le_compat_l; lra). lra. }
      apply (ends 2%Z (standing false) (to_the_rate L false)); auto; [cbn; auto | rewrite e0, e1; lra].
Qed.

Lemma one_period hs hr z after : all2 (slides_inside L seven r (gaps L closely r)) facets hs = true ->
  all2 (rests_inside L four) facets hr = true -> inside facets z -> period L facets x z after -> inside facets after.
Proof.
  intros ok_s ok_r ins [y (rate_ & moved & noise & r01 & pm & m & hn & how)]. split; [exact y |].
  assert (co : course rate_ moved noise) by (unfold course; auto). destruct ins as [vz all]. assert (ins := conj vz all : inside facets z).
  rewrite Forall_forall in all. apply Forall_forall. intros f i.
  destruct (all2_in _ _ _ f ok_s i) as [h1 k1]. destruct (all2_in _ _ _ f ok_r i) as [h2 k2].
  destruct how as [sl | (stop & ps & lines & cond & re)].
  - unfold slides in sl. rewrite Forall_forall in sl. destruct (sl f i) as (cut & s & b & ic & is & ib & le).
    eapply Rle_trans; [exact le |]. apply (slides_sound f h1 cut s b z rate_ moved noise); auto.
  - rewrite Forall_forall in re. destruct (re f i) as (s & share & is & ih & le).
    eapply Rle_trans; [exact le |]. apply (rests_sound f h2 s share z rate_ moved noise stop); auto.
Qed.

Lemma some_slice z : exists place, In place [0; 1; 2]%Z /\ slice L place z.
Proof.
  destruct (Rle_or_lt (error z) 0) as [h | h]; [exists 0%Z; cbn; auto |].
  destruct (Rle_or_lt (error z) (Q2R (turn L))) as [g | g]; [exists 1%Z | exists 2%Z]; unfold slice; cbn; repeat split; auto; lra.
Qed.

Lemma pushes_sound p z rate_ noise : pushes_within L flat p = true -> inside facets z -> 0 <= rate_ <= Q2R (rate L) ->
  Rabs noise <= Q2R (slip_gain L * slip_noise L) -> Q2R (push_low p) <= push L z rate_ noise <= Q2R (push_high p).
Proof.
  intros ok ins [r0 r1] hn. destruct (some_slice z) as (place & i & sl). unfold pushes_within in ok.
  destruct (all2_in _ _ _ (arena_of L facets place (slice_table L facets place)) ok) as [h both].
  { unfold flat. apply (in_map (fun i => arena_of L facets i (slice_table L facets i))). exact i. }
  apply andb_prop in both as [lo hi].
  destruct (sign_facts L facets right_signs) as (_ & _ & pt & _ & _ & _ & _ & _ & _ & _ & ps & _).
  assert (zero : dot (zero_row reals) (with_stop z 0) <= 1) by (unfold dot, zero_row, with_stop; cbn; rewrite Q2R_0; lra).
  assert (use : forall low k, at_most_one (arena_of L facets place (slice_table L facets place)) (zero_row closely)
      (lifted closely (push_row L low), number closely k) (if low then at_least h else at_largest h) = true ->
      dot (lifted reals (push_row L low)) (with_stop z 0) + Q2R k <= 1).
  { intros low k g.
    assert (b := at_most_one_sound L facets place _ (Vector 0 0 0 0)%Q _ (lifted reals (push_row L low), Q2R k) _ g
      (conj (lifted_near _) (number_near k)) (with_stop z 0) (slice_table_holds L facets right_signs place z 0 ins sl)
      (within_slice place z 0 ins sl (conj (Rle_refl 0) ps)) zero).
    cbn [fst snd] in b. assert (dot (lifted reals (Vector 0 0 0 0)%Q) (with_stop z 0) = 0) by (unfold dot, lifted, with_stop; cbn; rewrite Q2R_0; ring). lra. }
  assert (a := use true _ lo). assert (b := use false _ hi). clear use.
  assert (n1' := Rle_trans _ _ _ (Rle_abs _) hn). assert (hn2 := hn). rewrite <- Rabs_Ropp in hn2. assert (n2' := Rle_trans _ _ _ (Rle_abs _) hn2).
  unfold push_row, dot, lifted, with_stop, push in *. cbn [of_error of_rate of_level of_stop number reals] in *. push_down.
  assert (Q2R (target_gain L) * rate_ <= Q2R (target_gain L) * Q2R (rate L)) by (apply Rmult_le_compat_l; lra).
  assert (0 <= Q2R (target_gain L) * rate_) by (apply Rmult_le_pos; lra). lra.
Qed.
End Invariant.

(* ---------------------------------------------------------------- impulse responses, from their differential equation *)

Fixpoint ev (p : list Q) (t : R) : R := match p with nil => 0 | c :: p => Q2R c + t * ev p t end.
Fixpoint dv (p : list Q) (t : R) : R := match p with nil => 0 | c :: p => ev p t + t * dv p t end.
Fixpoint evaluated (p : list Q) (t : Q) : Q := match p with nil => 0%Q | c :: p => Qred (c + t * evaluated p t)%Q end.
Fixpoint raised (k : Z) (p : list Q) : list Q := match p with nil => nil | c :: p => (inject_Z k * c)%Q :: raised (Z.succ k) p end.
Definition derived (p : list Q) : list Q := match p with nil => nil | _ :: p => raised 1 p end.
(* a p + q *)
Fixpoint summed (a : Q) (p q : list Q) : list Q :=
  match p, q with
  | nil, _ => q
  | c :: p, nil => (a * c)%Q :: summed a p nil
  | c :: p, d :: q => Qred (a * c + d)%Q :: summed a p q
  end.
Definition sizes_of (p : list Q) : list Q := map magnitude p.

Lemma ev_derivable p t : derivable_pt_lim (ev p) t (dv p t).
Proof.
  induction p as [| c p ih]; cbn [ev dv]; [apply derivable_pt_lim_const |].
  replace (ev p t + t * dv p t) with (0 + (1 * ev p t + t * dv p t)) by ring.
  apply (derivable_pt_lim_plus (fun _ => Q2R c) (fun s => s * ev p s)); [apply derivable_pt_lim_const |].
  apply (derivable_pt_lim_mult (fun s => s) (ev p)); [apply derivable_pt_lim_id | exact ih].
Qed.

Lemma ev_raised p t : forall k, ev (raised k p) t = IZR k * ev p t + t * dv p t.
Proof.
  induction p as [| c p ih]; intro k; cbn [raised ev dv]; [ring |].
  rewrite ih, Q2R_mult, succ_IZR. replace (Q2R (inject_Z k)) with (IZR k) by (unfold Q2R, inject_Z; cbn; field). ring.
Qed.

Lemma ev_derived p t : ev (derived p) t = dv p t.
Proof. destruct p as [| c p]; cbn [derived]; [reflexivity |]. rewrite ev_raised. cbn [dv]. ring. Qed.

Lemma Qred_same q : Q2R (Qred q) = Q2R q.
Proof. apply Qeq_eqR, Qred_correct. Qed.

Lemma ev_summed a p : forall q t, ev (summed a p q) t = Q2R a * ev p t + ev q t.
Proof.
  induction p as [| c p ih]; intros [| d q] t; cbn [summed ev]; rewrite ?ih, ?Qred_same, ?Q2R_plus, ?Q2R_mult; cbn [ev]; ring.
Qed.

Lemma evaluated_sound p t : Q2R (evaluated p t) = ev p (Q2R t).
Proof. induction p as [| c p ih]; cbn [evaluated ev]; [apply Q2R_0 |]. rewrite Qred_same, Q2R_plus, Q2R_mult, ih. ring. Qed.

Lemma ev_bounded p t T : 0 <= t <= T -> Rabs (ev p t) <= ev (sizes_of p) T.
Proof.
  intros [l h]. induction p as [| c p ih]; cbn [sizes_of map ev] in *; [rewrite Rabs_R0; lra |].
  eapply Rle_trans; [apply Rabs_triang |]. rewrite magnitude_sound. apply Rplus_le_compat_l. rewrite Rabs_mult, (Rabs_pos_eq t) by exact l.
  apply Rmult_le_compat; auto using Rabs_pos.
Qed.

(* An energy that grows at most as fast as K times itself and c. *)
Lemma line_derivable a t : derivable_pt_lim (fun s => a * s) t a.
Proof.
  assert (h := derivable_pt_lim_mult (fun _ => a) (fun s => s) t 0 1 (derivable_pt_lim_const a t) (derivable_pt_lim_id t)).
  cbv beta in h. replace (0 * t + a * 1) with a in h by ring. exact h.
Qed.

Lemma grown E dE K c T : 0 <= K -> 0 <= c -> (forall t, derivable_pt_lim E t (dE t)) -> E 0 = 0 ->
  (forall t, 0 <= t <= T -> dE t <= K * E t + c) -> forall t, 0 <= t <= T -> E t <= c * t * exp (K * t).
Proof.
  intros pK pc der z0 grow t [l h]. set (F := fun s => E s * exp (- K * s) - c * s).
  set (dF := fun s => dE s * exp (- K * s) + E s * (exp (- K * s) * (- K)) - c).
  assert (derF : forall s, derivable_pt_lim F s (dF s)).
  { intro s. unfold F, dF. apply (derivable_pt_lim_minus (fun s => E s * exp (- K * s)) (fun s => c * s)).
    - apply (derivable_pt_lim_mult E (fun s => exp (- K * s))); [apply der |].
      apply (derivable_pt_lim_comp (fun s => - K * s) exp); [| apply derivable_pt_lim_exp].
      apply line_derivable.
    - apply line_derivable. }
  assert (low : F t <= 0).
  { destruct (Req_dec t 0) as [-> | ne]; [unfold F; rewrite z0, Rmult_0_l, Rmult_0_r; lra |].
    destruct (MVT_cor2 F dF 0 t) as [s [eq hs]]; [lra | intros; apply derF |].
    assert (F0 : F 0 = 0) by (unfold F; rewrite z0, Rmult_0_l, Rmult_0_r; lra). rewrite F0 in eq.
    assert (dF s <= 0).
    { unfold dF. assert (g := grow s ltac:(lra)). assert (pe := exp_pos (- K * s)).
      assert (exp (- K * s) <= 1). { rewrite <- exp_0. destruct (Req_dec (K * s) 0) as [e | n]; [right; f_equal; lra |].
        left. apply exp_increasing. assert (0 <= K * s) by (apply Rmult_le_pos; lra). lra. }
      assert (dE s * exp (- K * s) <= (K * E s + c) * exp (- K * s)) by (apply Rmult_le_compat_r; lra).
      assert (c * exp (- K * s) <= c * 1) by (apply Rmult_le_compat_l; lra). lra. }
    assert (dF s * (t - 0) <= 0) by nra. lra. }
  unfold F in low. replace (- K * t) with (- (K * t)) in low by ring. rewrite exp_Ropp in low. assert (pe := exp_pos (K * t)).
  apply Rmult_le_reg_r with (/ exp (K * t)); [now apply Rinv_0_lt_compat |]. rewrite Rmult_assoc, Rinv_r by lra. lra.
Qed.

Lemma exp_bounded x n : x <= IZR (Z.of_nat n) -> exp x <= 3 ^ n.
Proof.
  intro h. apply Rle_trans with (exp (IZR (Z.of_nat n))).
  - destruct h as [h | ->]; [left; now apply exp_increasing | right; reflexivity].
  - clear h. induction n as [| n ih]; [cbn; rewrite exp_0; lra |].
    rewrite Nat2Z.inj_succ, succ_IZR, exp_plus. cbn [pow]. rewrite Rmult_comm.
    apply Rmult_le_compat; try (left; apply exp_pos); [apply exp_le_3 | exact ih].
Qed.

Section Impulse.
Variable L : loop.
Let s0 := ((slope_low L + slope_high L) * half)%Q.
Let w0 := ((damping_low L + damping_high L) * half)%Q.

(* Slip X and slip rate Y after a unit impulse, and the integral Z of X. *)
Definition impulse (X Y Z : R -> R) : Prop :=
  (forall t, derivable_pt_lim X t (Y t)) /\ (forall t, derivable_pt_lim Y t (Q2R s0 * X t - Q2R w0 * Y t)) /\
  (forall t, derivable_pt_lim Z t (X t)) /\ X 0 = 0 /\ Y 0 = 1 /\ Z 0 = 0.
Definition times_of_nodes : list Q := map (fun i => step L * (i # 1) / 16)%Q [16; 15; 14; 13; 12; 11; 10; 9; 8; 7; 6; 5; 4; 3; 2; 1; 0]%Z.
Definition responses_of (X Y Z : R -> R) : responses R :=
  Responses (map (fun t => (X (Q2R t), Y (Q2R t))) times_of_nodes) (Z (Q2R (step L))) (X (Q2R (step L))).

(* Taylor's polynomials, for which nothing is assumed: what they lack of a solution is computed. *)
Fixpoint coefficients (n : nat) (k : Z) (x y z : Q) : list Q * list Q * list Q :=
  match n with
  | O => (nil, nil, nil)
  | S n => let '(a, b, c) := coefficients n (Z.succ k) (Qred (y / inject_Z k)) (Qred ((s0 * x - w0 * y) / inject_Z k)) (Qred (x / inject_Z k)) in
      (x :: a, y :: b, z :: c)
  end.

Section Polynomials.
Variables px py pz : list Q.
Definition lack_x : list Q := summed (-1#1) py (derived px).
Definition lack_y : list Q := summed (- s0) px (summed w0 py (derived py)).
Definition lack_z : list Q := summed (-1#1) px (derived pz).
Definition most (p : list Q) : Q := evaluated (sizes_of p) (step L).
Definition close (off : Q) (a : near) (q : Q) : bool :=
  Qle_bool (magnitude (q * inject_Z scale - inject_Z (middle a)) + off * inject_Z scale) (inject_Z (radius a)).

Definition solved (n : nat) (off : Q) : bool :=
  Qeq_bool (evaluated px 0) 0 && Qeq_bool (evaluated py 0) 1 && Qeq_bool (evaluated pz 0) 0 && Qle_bool 0 off && Qle_bool 0 (step L)
  && Qle_bool ((3 + magnitude s0 + 2 * magnitude w0) * step L) (inject_Z (Z.of_nat n))
  && Qle_bool ((most lack_x * most lack_x + most lack_y * most lack_y + most lack_z * most lack_z) * step L * inject_Z (3 ^ Z.of_nat n)) (off * off).
Definition enclosed (r : responses near) (n : nat) (off : Q) : bool :=
  solved n off && all2 (fun a t => close off (fst a) (evaluated px t) && close off (snd a) (evaluated py t) && Qle_bool 0 t && Qle_bool t (step L))
    (nodes r) times_of_nodes
  && close off (held_slip r) (evaluated pz (step L)) && close off (held_rate r) (evaluated px (step L)).

Variables X Y Z : R -> R.
Hypothesis motion : impulse X Y Z.

Lemma Q2R_whole z : Q2R (inject_Z z) = IZR z.
Proof. unfold Q2R, inject_Z. cbn. field. Qed.

Lemma square_bounded u v : Rabs u <= v -> u * u <= v * v.
Proof. intro h. rewrite <- (Rabs_pos_eq (u * u)) by apply Rle_0_sqr. rewrite Rabs_mult. apply Rmult_le_compat; auto using Rabs_pos. Qed.

Lemma solution_near n off : solved n off = true -> forall t, 0 <= t <= Q2R (step L) ->
  Rabs (X t - ev px t) <= Q2R off /\ Rabs (Y t - ev py t) <= Q2R off /\ Rabs (Z t - ev pz t) <= Q2R off.
Proof.
  intros ok t ht. unfold solved in ok. do 6 (apply andb_prop in ok as [ok ?]).
  repeat match goal with h : Qle_bool _ _ = true |- _ => apply below_true in h end.
  repeat match goal with h : Qeq_bool _ _ = true |- _ => apply Qeq_bool_iff, Qeq_eqR in h; rewrite evaluated_sound, Q2R_0 in h end.
  rewrite Q2R_0, Q2R_1 in *.
  repeat match goal with h : context [Q2R (_ * _)] |- _ => rewrite !Q2R_mult in h end. rewrite ?Q2R_whole in *.
  match goal with h : _ <= IZR (Z.of_nat n) |- _ => rewrite !Q2R_plus, !Q2R_mult, !magnitude_sound in h end.
  match goal with h : _ <= Q2R off * Q2R off |- _ => rewrite !Q2R_plus, !Q2R_mult in h end.
  destruct motion as (dX & dY & dZ & X0 & Y0 & Z0).
  set (x := fun t => X t - ev px t) in *. set (y := fun t => Y t - ev py t) in *. set (z := fun t => Z t - ev pz t) in *.
  assert (lx : forall t, dv px t = ev lack_x t + ev py t) by (intro; unfold lack_x; rewrite ev_summed, ev_derived, Q2R_m1; ring).
  assert (ly : forall t, dv py t = ev lack_y t + Q2R s0 * ev px t - Q2R w0 * ev py t).
  { intro. unfold lack_y. rewrite !ev_summed, ev_derived, Q2R_opp. ring. }
  assert (lz : forall t, dv pz t = ev lack_z t + ev px t) by (intro; unfold lack_z; rewrite ev_summed, ev_derived, Q2R_m1; ring).
  set (E := fun t => x t * x t + y t * y t + z t * z t).
  set (dE := fun t => 2 * (x t * (y t - ev lack_x t) + y t * (Q2R s0 * x t - Q2R w0 * y t - ev lack_y t) + z t * (x t - ev lack_z t))).
  set (K := 3 + Rabs (Q2R s0) + 2 * Rabs (Q2R w0)).
  set (c := Q2R (most lack_x) * Q2R (most lack_x) + Q2R (most lack_y) * Q2R (most lack_y) + Q2R (most lack_z) * Q2R (most lack_z)).
  assert (der : forall t, derivable_pt_lim E t (dE t)).
  { intro s. unfold E, dE.
    assert (hx : derivable_pt_lim x s (y s - ev lack_x s)).
    { replace (y s - ev lack_x s) with (Y s - dv px s) by (unfold y; rewrite lx; ring).
    apply derivable_pt_lim_minus; [apply dX | apply ev_derivable]. }
    assert (hy : derivable_pt_lim y s (Q2R s0 * x s - Q2R w0 * y s - ev lack_y s)).
    { replace (Q2R s0 * x s - Q2R w0 * y s - ev lack_y s) with (Q2R s0 * X s - Q2R w0 * Y s - dv py s) by (unfold x, y; rewrite ly; ring).
      apply derivable_pt_lim_minus; [apply dY | apply ev_derivable]. }
    assert (hz : derivable_pt_lim z s (x s - ev lack_z s)).
    { replace (x s - ev lack_z s) with (X s - dv pz s) by (unfold x; rewrite lz; ring).
    apply derivable_pt_lim_minus; [apply dZ | apply ev_derivable]. }
    assert (h := derivable_pt_lim_plus _ _ _ _ _ (derivable_pt_lim_plus _ _ _ _ _ (derivable_pt_lim_mult x x s _ _ hx hx) (derivable_pt_lim_mult y y s _ _ hy hy)) (derivable_pt_lim_mult z z s _ _ hz hz)).
    match type of h with derivable_pt_lim _ _ ?l =>
      replace (2 * _) with l by ring end. exact h. }
  assert (grow : forall s, 0 <= s <= Q2R (step L) -> dE s <= K * E s + c).
  { intros s hs. unfold dE, E, K, c.
    assert (bx := square_bounded _ _ (ev_bounded lack_x s _ hs)). assert (by_ := square_bounded _ _ (ev_bounded lack_y s _ hs)).
    assert (bz := square_bounded _ _ (ev_bounded lack_z s _ hs)). unfold most. rewrite !evaluated_sound.
    generalize dependent (ev lack_x s). generalize dependent (ev lack_y s). generalize dependent (ev lack_z s). intros rz bz ry by_ rx bx.
    generalize (x s) (y s) (z s). intros a b d.
    assert (sq : forall u v, 2 * u * v <= u * u + v * v) by (intros u v; assert (0 <= (u - v) * (u - v)) by apply Rle_0_sqr; lra).
    assert (hS : 2 * Q2R s0 * (a * b) <= Rabs (Q2R s0) * (a * a + b * b)).
    { assert (h1 := sq a b). assert (h2 := sq a (- b)). unfold Rabs. destruct Rcase_abs; nra. }
    assert (hw : - (Q2R w0 * (b * b)) <= Rabs (Q2R w0) * (b * b)).
    { assert (0 <= b * b) by apply Rle_0_sqr. assert (h := Rle_abs (- Q2R w0)). rewrite Rabs_Ropp in h. nra. }
    assert (0 <= Rabs (Q2R s0) * (d * d)) by (apply Rmult_le_pos; [apply Rabs_pos | apply Rle_0_sqr]).
    assert (0 <= Rabs (Q2R w0) * (a * a)) by (apply Rmult_le_pos; [apply Rabs_pos | apply Rle_0_sqr]).
    assert (0 <= Rabs (Q2R w0) * (d * d)) by (apply Rmult_le_pos; [apply Rabs_pos | apply Rle_0_sqr]).
    assert (h1 := sq a b). assert (h2 := sq a (- rx)). assert (h3 := sq b (- ry)). assert (h4 := sq d a). assert (h5 := sq d (- rz)).
    assert (0 <= a * a) by apply Rle_0_sqr. assert (0 <= b * b) by apply Rle_0_sqr. assert (0 <= d * d) by apply Rle_0_sqr. lra. }
  assert (E0 : E 0 = 0). { unfold E, x, y, z. rewrite X0, Y0, Z0.
    repeat match goal with h : ev _ 0 = _ |- _ => rewrite h end. ring. }
  assert (pK : 0 <= K) by (unfold K; assert (a := Rabs_pos (Q2R s0)); assert (b := Rabs_pos (Q2R w0)); lra).
  assert (pc : 0 <= c) by (unfold c; assert (a := Rle_0_sqr (Q2R (most lack_x))); assert (b := Rle_0_sqr (Q2R (most lack_y))); assert (d := Rle_0_sqr (Q2R (most lack_z))); unfold Rsqr in *; lra).
  assert (g := grown E dE K c _ pK pc der E0 grow t ht).
  assert (up : exp (K * t) <= 3 ^ n).
  { apply exp_bounded. eapply Rle_trans; [apply Rmult_le_compat_l; [exact pK | apply ht] |].
    match goal with h : _ <= IZR (Z.of_nat n) |- _ => eapply Rle_trans; [| exact h] end. right. unfold K.
    replace (Q2R 3) with 3 by (unfold Q2R; cbn; field). replace (Q2R 2) with 2 by (unfold Q2R; cbn; field). reflexivity. }
  match goal with h : _ <= Q2R off * Q2R off |- _ => rename h into small end. rewrite <- pow_IZR in small.
  assert (whole : E t <= Q2R off * Q2R off).
  { eapply Rle_trans; [exact g |]. eapply Rle_trans; [| exact small]. fold c. destruct ht as [l h].
    apply Rmult_le_compat; [apply Rmult_le_pos; assumption | left; apply exp_pos | apply Rmult_le_compat_l; assumption | exact up]. }
  assert (off0 : 0 <= Q2R off) by assumption.
  assert (sq : forall u, u * u <= Q2R off * Q2R off -> Rabs u <= Q2R off).
  { intros u h. rewrite <- (Rabs_pos_eq (Q2R off)) by exact off0. apply Rsqr_le_abs_0. exact h. }
  assert (xx := Rle_0_sqr (x t)). assert (yy := Rle_0_sqr (y t)). assert (zz := Rle_0_sqr (z t)). unfold Rsqr, E in *.
  repeat split; [apply (sq (x t)) | apply (sq (y t)) | apply (sq (z t))]; lra.
Qed.

Lemma close_sound off a q v : close off a q = true -> Rabs (v - Q2R q) <= Q2R off -> is_near a v.
Proof.
  intros ok h. unfold close in ok. apply below_true in ok. rewrite Q2R_plus, magnitude_sound, Q2R_minus, !Q2R_mult, !Q2R_whole in ok.
  unfold is_near. assert (pu := scale_positive).
  replace (v * IZR scale - IZR (middle a)) with ((Q2R q * IZR scale - IZR (middle a)) + (v - Q2R q) * IZR scale) by ring.
  eapply Rle_trans; [apply Rabs_triang |]. eapply Rle_trans; [| exact ok]. apply Rplus_le_compat_l.
  rewrite Rabs_mult, (Rabs_pos_eq (IZR scale)) by lra. apply Rmult_le_compat_r; lra.
Qed.

Theorem responses_near r n off : enclosed r n off = true -> near_responses r (responses_of X Y Z).
Proof.
  intro ok. unfold enclosed in ok. apply andb_prop in ok as [ok kr]. apply andb_prop in ok as [ok ks]. apply andb_prop in ok as [so kn].
  assert (near_all := solution_near n off so).
  assert (pT : 0 <= Q2R (step L)).
  { unfold solved in so. do 6 (apply andb_prop in so as [so ?]).
  match goal with h : Qle_bool 0 (step L) = true |- _ => apply below_true in h; rewrite Q2R_0 in h; exact h end. }
  assert (at_end := near_all (Q2R (step L)) (conj pT (Rle_refl _))). destruct at_end as (ex & _ & ez).
  split; [| split; [apply (close_sound off _ _ _ ks) | apply (close_sound off _ _ _ kr)]; rewrite evaluated_sound; assumption].
  unfold responses_of. cbn [nodes]. revert kn. generalize (nodes r) times_of_nodes. intros a times. revert a.
  induction times as [| t times ih]; intros [| u a] h; cbn [all2 map] in *; try discriminate; constructor.
  - apply andb_prop in h as [h _]. do 3 (apply andb_prop in h as [h ?]).
    repeat match goal with h : Qle_bool _ _ = true |- _ => apply below_true in h; rewrite ?Q2R_0 in h end.
    destruct (near_all (Q2R t)) as (hx & hy & _); [split; assumption |].
    split; [apply (close_sound off _ (evaluated px t)) | apply (close_sound off _ (evaluated py t))]; try assumption; rewrite evaluated_sound; assumption.
  - apply ih. now apply andb_prop in h as [_ h].
Qed.
End Polynomials.
End Impulse.

(* Taylor's polynomials of so many terms, 3^n at least e^KT, and what they may be off. *)
Definition follows_from_flow (L : loop) (r : responses near) (terms n : nat) (off : Q) : bool :=
  let '(px, py, pz) := coefficients L terms 1 0%Q 1%Q 0%Q in enclosed L px py pz r n off.

(* From rest, for ever: where every period from inside of the polytope is one of the two maps, no sample leaves it, and the
   claims hold at every sample, with what the reference moves in a period to spare. *)
Definition guaranteed (L : loop) (facets : list facet) (c : claims) : Prop :=
  forall X Y Z : R -> R, impulse L X Y Z -> forall z : nat -> state, begun L (z 0%nat) ->
  (forall k, inside facets (z k) -> period L facets (responses_of L X Y Z) (z k) (z (S k))) ->
  forall k, inside facets (z k) /\
    let moved := Q2R (step L) * Q2R (rate L - told L) in let e := error (z k) - Q2R (slip_noise L) in
    - Q2R (slip_behind c) <= e - moved /\ e + moved <= Q2R (slip_ahead c) /\ 0 <= velocity (z k) <= Q2R (peak_slip_rate c) /\
    forall rate_ noise rest, 0 <= rate_ <= Q2R (rate L) -> Rabs noise <= Q2R (slip_gain L * slip_noise L) ->
      Q2R (rest_low c) <= rest <= Q2R (rest_high c) ->
      Q2R (least_pressure c) <= rest - push L (z k) rate_ noise <= Q2R (largest_pressure c).

Theorem polytope_sound (L : loop) (facets : list facet) (r : responses near) (p : proposals) (c : claims) terms n off :
  accepts L facets r p = true -> follows L facets p c = true -> follows_from_flow L r terms n off = true -> guaranteed L facets c.
Proof.
  intros ok fo flow X Y Z motion z at_first every.
  assert (known : near_responses r (responses_of L X Y Z)).
  { unfold follows_from_flow in flow. destruct (coefficients L terms 1 0%Q 1%Q 0%Q) as [[px py] pz].
    exact (responses_near L px py pz X Y Z motion r n off flow). }
  set (x := responses_of L X Y Z) in *.
  unfold accepts in ok. cbv zeta in ok. do 5 (apply andb_prop in ok as [ok ?]).
  assert (stays : forall k, inside facets (z k)).
  { induction k as [| k ih].
    - destruct at_first as (e & v & l). split; [rewrite v; lra |]. apply Forall_forall. intros f i. unfold reach. rewrite e, v.
      match goal with h : begins_inside _ _ = true |- _ => unfold begins_inside in h; rewrite forallb_forall in h;
        specialize (h f i); apply below_true in h end.
      match goal with h : Q2R _ <= Q2R 1 |- _ => rename h into first_ end.
      rewrite Q2R_plus, !Q2R_mult, positive_part_sound, Q2R_1 in first_. rewrite Q2R_mult in l.
      assert (Q2R (n3 f) * level (z 0%nat) <= Rmax 0 (Q2R (n3 f)) * (Q2R (slip_gain L) * Q2R (slip_noise L))).
      { eapply Rle_trans; [apply Rmult_le_compat_r; [lra | apply (Rmax_r 0)] |]. apply Rmult_le_compat_l; [apply Rmax_l | lra]. }
      lra.
    - match goal with s : signs _ _ = true, b : boxed _ = true, hs : all2 (slides_inside _ _ _ _) _ _ = true,
        hr : all2 (rests_inside _ _) _ _ = true |- _ => exact (one_period L facets s b r x known _ _ (z k) (z (S k)) hs hr ih (every k ih)) end. }
  intro k. split; [apply stays |]. cbv zeta.
  unfold follows in fo. cbv zeta in fo. do 4 (apply andb_prop in fo as [fo ?]).
  repeat match goal with h : Qle_bool _ _ = true |- _ => apply below_true in h end. push_down.
  match goal with s : signs _ _ = true, b : boxed _ = true |- _ => destruct (box L facets s b (z k) (stays k)) as (reached & v & _) end.
  destruct (stays k) as [y _]. split; [lra |]. split; [lra |]. split; [split; lra |]. intros rate_ noise rest hr hn [p0 p1].
  match goal with h : pushes_within _ _ _ = true, s : signs _ _ = true, bx : boxed _ = true |- _ =>
    assert (g := pushes_sound L facets s bx p (z k) rate_ noise h (stays k) hr ltac:(rewrite Q2R_mult; exact hn)) end. lra.
Qed.
